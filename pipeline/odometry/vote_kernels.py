"""Overlap of two scans for every shift of one of them, on a grid of cells."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit


@njit(cache=True, nogil=True)
def votes(occupied: npt.NDArray[np.bool_], cells: npt.NDArray[np.int32], across: int, up: int) -> npt.NDArray[np.int32]:
    """How many of the cells (n, 3) fall on occupied ones, for each shift along x, y (-across..across), z (-up..up)."""
    out = np.zeros((2 * across + 1, 2 * across + 1, 2 * up + 1), np.int32)
    nx, ny, nz = occupied.shape
    for n in range(len(cells)):
        for i in range(-across, across + 1):
            x = cells[n, 0] + i
            if x < 0 or x >= nx:
                continue
            for j in range(-across, across + 1):
                y = cells[n, 1] + j
                if y < 0 or y >= ny:
                    continue
                for k in range(-up, up + 1):
                    z = cells[n, 2] + k
                    if 0 <= z < nz and occupied[x, y, z]:
                        out[i + across, j + across, k + up] += 1
    return out
