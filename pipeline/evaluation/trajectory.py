"""How far an estimated trajectory is from the true one: APE, RPE, drift and consistency, as `evo` defines them.

Positions (n, 3) in m, rotations (n, 3, 3), times (n,) integer ns. `associate` brings two trajectories to common times.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]


class Alignment(Enum):
    """What is taken out before errors are measured. A georeferenced trajectory is compared with NONE."""

    SE3 = "se3"
    YAW = "yaw"
    """Translation and heading: what an odometry that knows gravity leaves open."""
    ORIGIN = "origin"
    """The first pose is laid on the true one."""
    NONE = "none"


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """stamp_ns (n,), position_m (n, 3), rotation (n, 3, 3) body to world."""

    stamp_ns: Stamps
    position_m: Doubles
    rotation: Doubles

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def moved(self, turn: Doubles, shift: Doubles) -> Poses:
        """Seen from another frame: x' = turn x + shift."""
        return Poses(self.stamp_ns, self.position_m @ turn.T + shift, turn @ self.rotation)

    def pick(self, index: npt.NDArray[np.int64]) -> Poses:
        """Some of them."""
        return Poses(self.stamp_ns[index], self.position_m[index], self.rotation[index])


@dataclass(frozen=True, slots=True)
class Errors:
    """Of a set of errors in one unit."""

    rmse: float
    mean: float
    median: float
    worst: float

    @classmethod
    def of(cls, values: Doubles) -> Errors:
        """Of (n,) values, n >= 1."""
        return cls(
            float(np.sqrt(np.mean(values**2))),
            float(np.mean(values)),
            float(np.median(values)),
            float(np.max(values)),
        )


def associate(estimate: Poses, truth: Poses, apart_ns: int = 20_000_000) -> tuple[Poses, Poses]:
    """The pairs that are nearest in time, none farther apart. ValueError when there are fewer than two."""
    after = np.clip(np.searchsorted(truth.stamp_ns, estimate.stamp_ns), 1, len(truth) - 1)
    early = estimate.stamp_ns - truth.stamp_ns[after - 1] < truth.stamp_ns[after] - estimate.stamp_ns
    nearest = after - early
    near = np.abs(truth.stamp_ns[nearest] - estimate.stamp_ns) <= apart_ns
    if near.sum() < 2:
        raise ValueError("the trajectories share less than two instants: are they in the same time?")
    return estimate.pick(np.flatnonzero(near)), truth.pick(nearest[near])


def align(estimate: Poses, truth: Poses, alignment: Alignment) -> Poses:
    """The estimate moved onto the truth, pose by pose the same instants (Umeyama without scale)."""
    if alignment is Alignment.NONE:
        return estimate
    if alignment is Alignment.ORIGIN:
        turn = truth.rotation[0] @ estimate.rotation[0].T
        return estimate.moved(turn, truth.position_m[0] - turn @ estimate.position_m[0])
    middle, goal = estimate.position_m.mean(axis=0), truth.position_m.mean(axis=0)
    cross = (truth.position_m - goal).T @ (estimate.position_m - middle)
    turn = _yaw(cross) if alignment is Alignment.YAW else _turn(cross)
    return estimate.moved(turn, goal - turn @ middle)


def position_errors(estimate: Poses, truth: Poses) -> Doubles:
    """Distance (n,) between the positions, m."""
    return np.asarray(np.linalg.norm(estimate.position_m - truth.position_m, axis=1))


def ape(estimate: Poses, truth: Poses, alignment: Alignment) -> Errors:
    """Absolute position error, m."""
    return Errors.of(position_errors(align(estimate, truth, alignment), truth))


def rpe(estimate: Poses, truth: Poses, distance_m: float) -> tuple[Errors, Errors] | None:
    """Relative error over every stretch of that length of the true way: m, and degrees. None where it is too short."""
    begin, end = _stretches(truth, distance_m)
    if len(begin) == 0:
        return None
    moved, turned = _between(estimate, begin, end)
    true_moved, true_turned = _between(truth, begin, end)
    error = np.einsum("nji,nj->ni", true_turned, moved - true_moved)
    rest = np.einsum("nji,njk->nik", true_turned, turned)
    cosine = np.clip(0.5 * (np.trace(rest, axis1=1, axis2=2) - 1.0), -1.0, 1.0)
    return Errors.of(np.linalg.norm(error, axis=1)), Errors.of(np.degrees(np.arccos(cosine)))


def length_m(poses: Poses) -> float:
    """Length of the way."""
    return float(np.linalg.norm(np.diff(poses.position_m, axis=0), axis=1).sum())


def nees(error: Doubles, covariance: Doubles) -> Doubles:
    """Normalised estimation error squared (n,) of errors (n, k): k on average where the covariance is honest."""
    return np.asarray(np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[:, :, None])[:, :, 0]))


def _turn(cross: Doubles) -> Doubles:
    left, _, right = np.linalg.svd(cross)
    sign = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(left @ right)))])
    return np.asarray(left @ sign @ right)


def _yaw(cross: Doubles) -> Doubles:
    yaw = np.arctan2(cross[1, 0] - cross[0, 1], cross[0, 0] + cross[1, 1])
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _stretches(truth: Poses, distance_m: float) -> tuple[Stamps, Stamps]:
    steps = np.linalg.norm(np.diff(truth.position_m, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    end = np.searchsorted(along, along + distance_m)
    begin = np.flatnonzero(end < len(along))
    return begin, end[begin]


def _between(poses: Poses, begin: Stamps, end: Stamps) -> tuple[Doubles, Doubles]:
    back = np.swapaxes(poses.rotation[begin], 1, 2)
    moved = np.einsum("nij,nj->ni", back, poses.position_m[end] - poses.position_m[begin])
    return moved, np.asarray(back @ poses.rotation[end])
