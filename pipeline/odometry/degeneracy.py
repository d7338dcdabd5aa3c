"""Which directions of a pose the scan itself tells nothing about, and keeping the filter honest along them.

Translation and rotation are judged apart, each with the other eliminated (Schur complement): raw eigenvalues would mix
metres and radians. A direction of scant information is damped, not cut: the prior of the filter then rules there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.odometry.config import DegeneracyConfig
from pipeline.odometry.so3 import Doubles


@dataclass(frozen=True, slots=True, eq=False)
class Observability:
    """Sigmas (3,) the scan alone gives along its own best to worst directions, of attitude (rad) and position (m).

    weak_attitude, weak_position: rows (k, 3) of directions that are not to be trusted, in body and odom axes.
    """

    attitude_rad: Doubles
    position_m: Doubles
    weak_attitude: Doubles
    weak_position: Doubles

    @property
    def degenerate(self) -> bool:
        """Whether any direction is weak."""
        return len(self.weak_attitude) + len(self.weak_position) > 0


def observe(information: Doubles, config: DegeneracyConfig) -> Observability:
    """Judge the information (6, 6) of attitude, then position, of one scan."""
    attitude, turns = _directions(information, slice(0, 3), slice(3, 6))
    position, ways = _directions(information, slice(3, 6), slice(0, 3))
    return Observability(attitude, position, turns[attitude > config.attitude_rad], ways[position > config.position_m])


def damp(information: Doubles, gradient: Doubles, seen: Observability, share: float) -> tuple[Doubles, Doubles]:
    """Information and gradient with only `share` left along the weak directions.

    They are marginalised out: crossed out, what they share with the other directions would pull at those.
    """
    if not seen.degenerate:
        return information, gradient
    weak = np.zeros((6, len(seen.weak_attitude) + len(seen.weak_position)))
    weak[:3, : len(seen.weak_attitude)] = seen.weak_attitude.T
    weak[3:, len(seen.weak_attitude) :] = seen.weak_position.T
    reached = information @ weak
    taken = (1.0 - share) * np.linalg.solve(weak.T @ reached + 1e-9 * np.eye(weak.shape[1]), weak.T)
    return information - reached @ taken @ information, gradient - reached @ (taken @ gradient)


def _directions(information: Doubles, own: slice, other: slice) -> tuple[Doubles, Doubles]:
    """Sigmas ascending (3,) and directions as rows (3, 3) of one block with the other one eliminated."""
    cross = information[own, other]
    rest = information[other, other] + 1e-9 * np.eye(3)
    block = information[own, own] - cross @ np.linalg.solve(rest, cross.T)
    values, vectors = np.linalg.eigh(0.5 * (block + block.T))
    return 1.0 / np.sqrt(np.maximum(values[::-1], 1e-12)), vectors[:, ::-1].T
