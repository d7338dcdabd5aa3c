"""The lowest points of each cell of the ground, in one pass."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def lowest(points_m: Array, origin_m: Array, cell_m: float, rows: int, columns: int, rank: int) -> Array:
    """(rows, columns) height of the point of that rank from below in each cell, or of the highest where there are
    fewer; NaN where there is none. points_m: (n, 3) within the grid."""
    held = np.full((rows, columns, rank + 1), np.inf)
    for k in range(len(points_m)):
        i = int((points_m[k, 0] - origin_m[0]) / cell_m)
        j = int((points_m[k, 1] - origin_m[1]) / cell_m)
        place, z = rank, points_m[k, 2]
        if z >= held[i, j, place]:
            continue
        while place > 0 and held[i, j, place - 1] > z:
            held[i, j, place] = held[i, j, place - 1]
            place -= 1
        held[i, j, place] = z
    height = np.full((rows, columns), np.nan)
    for i in range(rows):
        for j in range(columns):
            for place in range(rank, -1, -1):
                if held[i, j, place] < np.inf:
                    height[i, j] = held[i, j, place]
                    break
    return height
