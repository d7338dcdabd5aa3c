"""Scores of thousands of candidate poses at once: joint histograms and sums of moving samples on a fixed field."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit, prange

Array = npt.NDArray[np.float64]
SUMS = 6
"""Columns of `pose_sums`: n, sum a, sum b, sum a^2, sum b^2, sum ab."""


@njit(cache=True, nogil=True, inline="always")
def _entropy(counts: Array, total: float) -> float:
    """In nats."""
    found = 0.0
    for count in counts:
        if count > 0.0:
            share = count / total
            found -= share * math.log(share)
    return found


@njit(cache=True, nogil=True, inline="always")
def _interpolated(field: Array, known: npt.NDArray[np.bool_], x: float, y: float) -> float:
    """Between the four cells around, NaN where one of them is not known."""
    ix, iy = math.floor(x), math.floor(y)
    if ix < 0 or iy < 0 or ix + 1 >= field.shape[0] or iy + 1 >= field.shape[1]:
        return math.nan
    if not (known[ix, iy] and known[ix + 1, iy] and known[ix, iy + 1] and known[ix + 1, iy + 1]):
        return math.nan
    fx, fy = x - ix, y - iy
    near = (1.0 - fy) * field[ix, iy] + fy * field[ix, iy + 1]
    far = (1.0 - fy) * field[ix + 1, iy] + fy * field[ix + 1, iy + 1]
    value: float = (1.0 - fx) * near + fx * far
    return value


@njit(cache=True, nogil=True, parallel=True)
def pose_information(
    xy: Array, levels: npt.NDArray[np.int64], field: Array, known: npt.NDArray[np.bool_], poses: Array, bins: int
) -> Array:
    """(k, 3) for poses (k, 3): normalised mutual information (equation 4), joint entropy (nats), samples used.

    xy: (n, 2) samples about the pivot, in cells. levels: (n,) bin of each. field: (nx, ny) in 0..1, in the same cells,
    known where it says something. poses: x, y in cells of the pivot on the field's grid, yaw in radians. A sample gives
    to the two bins next to its interpolated value, by nearness: the score has no steps.
    """
    found = np.zeros((len(poses), 3))
    for k in prange(len(poses)):
        c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        joint = np.zeros(bins * bins)
        total = 0.0
        for i in range(len(xy)):
            x = c * xy[i, 0] - s * xy[i, 1] + poses[k, 0]
            y = s * xy[i, 0] + c * xy[i, 1] + poses[k, 1]
            value = _interpolated(field, known, x, y)
            if math.isnan(value):
                continue
            value *= bins - 1
            low = min(int(value), bins - 2)
            share = value - low
            at = levels[i] * bins + low
            joint[at] += 1.0 - share
            joint[at + 1] += share
            total += 1.0
        if total == 0.0:
            continue
        table = joint.reshape((bins, bins))
        of_samples, of_field = np.zeros(bins), np.zeros(bins)
        for a in range(bins):
            for b in range(bins):
                of_samples[a] += table[a, b]
                of_field[b] += table[a, b]
        both, apart = _entropy(joint, total), _entropy(of_samples, total) + _entropy(of_field, total)
        found[k, 0] = apart / both if both > 1e-12 else 1.0
        found[k, 1] = both
        found[k, 2] = total
    return found


@njit(cache=True, nogil=True, parallel=True)
def pose_sums(xy: Array, values: Array, field: Array, known: npt.NDArray[np.bool_], poses: Array) -> Array:
    """(k, SUMS) for poses (k, 3): what correlation and variance of samples b against the field a are made of.

    Arguments as of `pose_information`, with values (n,) for levels.
    """
    found = np.zeros((len(poses), SUMS))
    for k in prange(len(poses)):
        c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        n, sa, sb, saa, sbb, sab = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(len(xy)):
            x = c * xy[i, 0] - s * xy[i, 1] + poses[k, 0]
            y = s * xy[i, 0] + c * xy[i, 1] + poses[k, 1]
            a = _interpolated(field, known, x, y)
            if math.isnan(a):
                continue
            b = values[i]
            n += 1.0
            sa += a
            sb += b
            saa += a * a
            sbb += b * b
            sab += a * b
        found[k, 0], found[k, 1], found[k, 2] = n, sa, sb
        found[k, 3], found[k, 4], found[k, 5] = saa, sbb, sab
    return found
