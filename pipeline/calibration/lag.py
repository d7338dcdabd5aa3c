"""By how much two clocks are apart, roughly, from how two sensors on one body turned; nothing else need be known.

For each lag, the rotation between the sensors that brings the rates together best has a closed form: with the
cross-covariance C = sum a_i b_(i+lag)^T, the greatest sum of a_i . R b_(i+lag) over all rotations R is
s1 + s2 + sign(det C) s3 of its singular values (Arun et al. 1987; Umeyama 1991). That sum, divided by the lengths, is a
correlation between 0 and 1 that does not ask how the sensors are mounted, and the lag is where it is greatest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.turning import Angle, Array, Turning

GRID_S = 0.02
LEAST_OVERLAP_S = 4.0
APART_S = 0.4
"""A second peak nearer than this to the first is a shoulder of it: people sway at about 1 Hz."""


@dataclass(frozen=True, slots=True, eq=False)
class Lag:
    """later_s: what happens at a stamp of the first happens so much later by the second's stamps.

    correlation: 0..1 there. rival: of the best lag elsewhere. rotation: (3, 3), second's axes to the first's.
    """

    later_s: float
    correlation: float
    rival: float
    rotation: Array


def find_lag(first: Turning, second: Turning, least_s: float, most_s: float, overlap_s: float = LEAST_OVERLAP_S) -> Lag:
    """The best lag from `least_s` to `most_s`. CalibrationError when the two have too little time in common."""
    if not len(first) or not len(second):
        raise CalibrationError("one of the two recordings shows no turning at all")
    (a, have_a), (b, have_b) = _grid(first), _grid(second)
    lags_s = (int(second.begin_ns[0]) - int(first.begin_ns[0])) * 1e-9 + GRID_S * np.arange(1 - len(a), len(b))
    within = (lags_s >= least_s) & (lags_s <= most_s)
    seconds = GRID_S * _correlate(have_a, have_b)[within]
    enough = seconds >= overlap_s
    if not enough.any():
        raise CalibrationError(
            f"the two recordings have less than {overlap_s:g} s in common at any offset from {least_s:g} to "
            f"{most_s:g} s: were they made at the same time? Allow a greater offset, or record longer"
        )
    cross = np.stack([[_correlate(a[:, i], b[:, j])[within] for j in range(3)] for i in range(3)])
    cross = np.moveaxis(cross, 2, 0)[enough]
    energy = _correlate(np.sum(a**2, axis=1), have_b) * _correlate(have_a, np.sum(b**2, axis=1))
    score, rotations = _best_rotations(cross, np.sqrt(np.maximum(energy[within][enough], 1e-12)))
    lags_s, best = lags_s[within][enough], int(np.argmax(score))
    elsewhere = np.abs(lags_s - lags_s[best]) > APART_S
    rival = float(score[elsewhere].max()) if elsewhere.any() else 0.0
    return Lag(float(lags_s[best]), float(score[best]), rival, rotations[best])


def best_rotation(first: Array, second: Array) -> Array:
    """(3, 3) that turns vectors (n, 3) of the second's axes into those of the first's, by least squares."""
    _, rotations = _best_rotations((first.T @ second)[None], np.ones(1))
    return np.asarray(rotations[0])


def _best_rotations(cross: Array, length: Array) -> tuple[Array, Array]:
    left, values, right = np.linalg.svd(cross)
    sign = np.sign(np.linalg.det(left @ right))
    values[:, 2] *= sign
    left[:, :, 2] *= sign[:, None]
    return values.sum(axis=1) / length, left @ right


def _grid(turning: Turning) -> tuple[Array, Array]:
    """Rates each `GRID_S` (n, 3), without their mean and zero in holes; and whether there is one (n,)."""
    begin_ns = np.arange(int(turning.begin_ns[0]), int(turning.end_ns[-1]), round(GRID_S * 1e9), dtype=np.int64)
    end_ns = begin_ns + round(GRID_S * 1e9)
    angle = Angle(turning)
    have = angle.covers(begin_ns, end_ns, 0.0)
    rate = angle.mean_rate(begin_ns, end_ns, 0.0)
    rate = rate - np.median(turning.rate, axis=0)
    return np.where(have[:, None], rate, 0.0), have.astype(np.float64)


def _correlate(first: Array, second: Array) -> Array:
    """Sum of first[i] * second[i + k] for k from 1 - len(first) to len(second) - 1."""
    return np.asarray(signal.correlate(second, first, mode="full", method="fft"))
