"""Compiled sampling of the image's edge strength under the laser's edges."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

Doubles = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def sample(
    strength: npt.NDArray[np.float32], facing: npt.NDArray[np.int64], pixels: Doubles, value: Doubles, slope: Doubles
) -> int:
    """Fills value (n,) and slope (n, 2), its derivative by the pixel, zero outside the image; how many are inside.

    strength: (directions, height, width), bilinear between pixels. facing: (n,) which direction counts for each point.
    """
    _, height, width = strength.shape
    inside = 0
    for i in range(len(pixels)):
        value[i] = slope[i, 0] = slope[i, 1] = 0.0
        u, v = pixels[i, 0], pixels[i, 1]
        if not (0.0 <= u < width - 1 and 0.0 <= v < height - 1):
            continue
        column, row, k = int(u), int(v), facing[i]
        fu, fv = u - column, v - row
        a, b = strength[k, row, column], strength[k, row, column + 1]
        c, d = strength[k, row + 1, column], strength[k, row + 1, column + 1]
        value[i] = (a * (1.0 - fu) + b * fu) * (1.0 - fv) + (c * (1.0 - fu) + d * fu) * fv
        slope[i, 0] = (b - a) * (1.0 - fv) + (d - c) * fv
        slope[i, 1] = (c - a) * (1.0 - fu) + (d - b) * fu
        inside += 1
    return inside
