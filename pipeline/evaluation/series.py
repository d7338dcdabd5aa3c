"""Errors of a trajectory as they go: over time beside the stated sigmas, over stretches, and against chi-square."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtr, chdtri

from pipeline.evaluation.trajectory import (
    Alignment,
    Array,
    Spread,
    Trajectory,
    aligned,
    normalised_square,
    relative_errors,
    spread,
    travelled_m,
)

DEGREES = 3
"""Of freedom, of a position."""
STRETCHES_M = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)
FEWEST_STRETCHES = 20
SHARES = np.linspace(0.0, 1.0, 101)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Of n poses. seconds: (n,) since the first. estimate, true: the poses laid together.

    across_m: (n,) horizontal distance. up_m: (n,) signed. Sigmas and the normalised squared error (three degrees of
    freedom) are None where no covariance is stated, and where the estimate was laid over the truth: it is not of that.
    """

    seconds: Array
    estimate: Trajectory
    true: Trajectory
    across_m: Array
    up_m: Array
    across_sigma_m: Array | None = None
    up_sigma_m: Array | None = None
    squared: Array | None = None


@dataclass(frozen=True, slots=True)
class Stretch:
    """Relative errors over all stretches of a length."""

    length_m: float
    count: int
    metres: Spread


def error_series(estimate: Trajectory, truth: Trajectory, alignment: Alignment = "none") -> Series:
    """Both in one clock. ValueError without an overlap."""
    estimate = estimate.within(truth)
    true = truth.at(estimate.stamps_ns)
    moved = aligned(estimate, true, alignment)
    away = moved.positions_m - true.positions_m
    seconds = (estimate.stamps_ns - estimate.stamps_ns[0]) / 1e9
    errors = Series(seconds, moved, true, np.hypot(away[:, 0], away[:, 1]), away[:, 2])
    covariance = estimate.covariance
    if covariance is None or alignment != "none":
        return errors
    across = np.sqrt(covariance[:, 0, 0] + covariance[:, 1, 1])
    up, squared = np.sqrt(covariance[:, 2, 2]), normalised_square(away, covariance)
    return Series(seconds, moved, true, errors.across_m, errors.up_m, across, up, squared)


def stretch_errors(estimate: Trajectory, true: Trajectory) -> list[Stretch]:
    """RPE over every length of which the way holds enough stretches. Both at the same stamps."""
    way_m = travelled_m(true)
    found = []
    for length_m in STRETCHES_M:
        metres, _ = relative_errors(estimate, true, way_m, length_m)
        if len(metres) < FEWEST_STRETCHES:
            break
        found.append(Stretch(length_m, len(metres), spread(metres)))
    return found


def calibration(squared: Array) -> tuple[Array, Array]:
    """(101,) shares that chi-square expects below its quantiles, and those found there: equal when honest."""
    reached = np.sort(chdtr(DEGREES, squared))
    return SHARES, np.searchsorted(reached, SHARES, side="right") / len(reached)


def bounds(share: float = 0.95) -> tuple[float, float]:
    """Between which that share of normalised squared errors lies, as much below as above."""
    outside = (1.0 - share) / 2.0
    return float(chdtri(DEGREES, 1.0 - outside)), float(chdtri(DEGREES, outside))
