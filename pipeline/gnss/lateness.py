"""How late the fixes are stamped, from where the way bends.

A fix that is stamped too late lies back along the way. On a straight way that is an offset like any other, but not in
a bend. The receiver's error lasts (Gauss-Markov) and the odometry drifts, so what is compared is the change from one
fix to the next.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.gnss.config import FusionConfig
from pipeline.gnss.sighting import Sighting

FEWEST = 200
MOST_APART_S = 3.0
"""Across a longer pause nothing is known of the velocity."""
ROUNDS = 10
DEFLATION = 2.0
"""Of the information: without it the sigma is a little too small on walks with offsets of 10 m."""
NORMAL_MEDIAN = 1.18
"""Of the length of a vector of two standard normal components."""
LEAST_SIGMAS, LEAST_S = 3.5, 0.2

Complex = npt.NDArray[np.complex128]
Real = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Lateness:
    """late_s: by how much the stamps are too late. aside_s: the same across the way, where there should be none."""

    late_s: float
    aside_s: float
    sigma_s: float

    @property
    def sure(self) -> bool:
        """Whether the stamps are late for certain, or early, and by enough to matter."""
        along, across = abs(self.late_s), abs(self.aside_s)
        return along > LEAST_S and along > LEAST_SIGMAS * self.sigma_s and across < LEAST_SIGMAS * self.sigma_s

    def __str__(self) -> str:
        which = "late" if self.late_s > 0.0 else "early"
        return (
            f"GNSS fixes are stamped {abs(self.late_s):.1f} s {which} (+-{self.sigma_s:.1f} s): "
            f"set fusion.stamped_late_s = {self.late_s:.1f}"
        )


def lateness(sightings: Sequence[Sighting], config: FusionConfig) -> Lateness | None:
    """By reweighted least squares (Huber). None while the way has told too little.

    East + i north. fix = c (antenna - late * velocity) + constant, with c the turn of `odom` in `map`; unknown are the
    constant, c and c * late.
    """
    if len(sightings) < FEWEST:
        return None
    seconds = np.array([one.passage.stamp_ns for one in sightings]) / 1e9
    antenna = _plane([one.passage.antenna_m for one in sightings])
    fixes = _plane([one.position_m for one in sightings])
    sigma_m = np.array([one.sigma_m[0] for one in sightings])
    kinds = np.array([one.quality for one in sightings])
    apart_s = np.diff(seconds)
    steady = (apart_s > 0.0) & (apart_s < MOST_APART_S)
    moving = np.concatenate([[False], steady[1:] & steady[:-1], [False]])  # where the velocity is known
    usable = moving[1:] & moving[:-1] & (kinds[1:] == kinds[:-1])
    if usable.sum() < FEWEST:
        return None
    keep = np.exp(-apart_s / config.correlation_s) if config.correlation_s else np.zeros(len(apart_s))
    velocity = np.zeros(len(antenna), complex)
    velocity[1:-1] = (antenna[2:] - antenna[:-2]) / np.maximum(seconds[2:] - seconds[:-2], 1e-3)
    design = np.column_stack([np.ones(len(antenna)), antenna - antenna.mean(), -velocity])
    changes = (design[1:] - keep[:, None] * design[:-1])[usable]
    spread_m = (sigma_m[1:] * np.sqrt(1.0 - keep**2 * (1.0 - config.white_share**2)))[usable]
    return _solved(changes, (fixes[1:] - keep * fixes[:-1])[usable], spread_m, config.huber)


def _solved(changes: Complex, seen: Complex, spread_m: Real, huber: float) -> Lateness | None:
    weights = 1.0 / spread_m
    for _ in range(ROUNDS):
        weighted = changes * weights[:, None]
        found, _, rank, _ = np.linalg.lstsq(weighted, seen * weights, rcond=1e-6)
        if rank < changes.shape[1]:
            return None
        off = np.abs(seen - changes @ found) / spread_m
        scale = max(float(np.median(off)) / NORMAL_MEDIAN, 1e-9)
        weights = np.sqrt(np.minimum(1.0, huber * scale / np.maximum(off, 1e-9))) / spread_m
    turn = found[1]
    variance = float(np.linalg.inv(weighted.conj().T @ weighted)[2, 2].real)
    late = found[2] * turn.conjugate() / abs(turn) ** 2
    return Lateness(float(late.real), float(late.imag), scale * math.sqrt(DEFLATION * variance) / float(abs(turn)))


def _plane(positions_m: Sequence[npt.NDArray[np.float64]]) -> Complex:
    return np.array([complex(x, y) for x, y, _ in positions_m])
