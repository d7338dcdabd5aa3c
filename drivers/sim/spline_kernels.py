"""Uniform quintic B-spline: value, first and second derivative at many times."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

# Basis times 120: row j is the polynomial in the share of the interval, constant first, of control point k - 2 + j.
BASIS: npt.NDArray[np.float64] = (
    np.array(
        [
            [1, -5, 10, -10, 5, -1],
            [26, -50, 20, 20, -20, 5],
            [66, 0, -60, 0, 30, -10],
            [26, 50, 20, -20, -20, 10],
            [1, 5, 10, 10, 5, -5],
            [0, 0, 0, 0, 0, 1],
        ],
        dtype=np.float64,
    )
    / 120.0
)


@njit(cache=True, nogil=True)
def evaluate(control: npt.NDArray[np.float64], t_ns: npt.NDArray[np.int64], knot_ns: int) -> npt.NDArray[np.float64]:
    """(n, 3, c): value, rate and second derivative a second of c channels. Times clamped, ends held."""
    last, channels = control.shape[0] - 1, control.shape[1]
    per_s = 1e9 / knot_ns
    out = np.zeros((t_ns.shape[0], 3, channels))
    for n in range(t_ns.shape[0]):
        t = min(max(t_ns[n], 0), last * knot_ns)
        k = t // knot_ns
        f = (t - k * knot_ns) / knot_ns
        for j in range(6):
            value, rate, second = 0.0, 0.0, 0.0
            for power in range(5, -1, -1):
                second = second * f + 2.0 * rate
                rate = rate * f + value
                value = value * f + BASIS[j, power]
            row = min(max(k - 2 + j, 0), last)
            for c in range(channels):
                out[n, 0, c] += value * control[row, c]
                out[n, 1, c] += rate * per_s * control[row, c]
                out[n, 2, c] += second * per_s * per_s * control[row, c]
    return out
