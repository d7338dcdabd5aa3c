"""Which solids stand over which cell of the terrain, and how high there."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

FRUSTUM, ELLIPSOID = 0, 1
Row = npt.NDArray[np.float32]


@njit(cache=True, nogil=True)
def _over(s: Row, kind: int, x0: float, y0: float, cell: float) -> tuple[float, float]:
    """Lowest and highest z of a solid over the square at (x0, y0); highest below lowest when it is not there."""
    if kind != FRUSTUM:
        nx, ny = min(max(s[0], x0), x0 + cell), min(max(s[1], y0), y0 + cell)
        wide = s[3] if kind == ELLIPSOID else math.hypot(s[3], s[4])
        tall = s[4] if kind == ELLIPSOID else s[5]
        if (nx - s[0]) ** 2 + (ny - s[1]) ** 2 > wide * wide:
            return 1.0, 0.0
        return s[2] - tall, s[2] + tall
    wide = max(s[7], s[7] + s[8] * s[6])
    first, last = 0.0, float(s[6])
    for base, axis, low in ((s[0], s[3], x0 - wide), (s[1], s[4], y0 - wide)):
        high = low + cell + 2.0 * wide
        if abs(axis) < 1e-9:
            if base < low or base > high:
                return 1.0, 0.0
            continue
        a, b = (low - base) / axis, (high - base) / axis
        first, last = max(first, min(a, b)), min(last, max(a, b))
    if first > last:
        return 1.0, 0.0
    za, zb = s[2] + first * s[5], s[2] + last * s[5]
    return min(za, zb) - wide, max(za, zb) + wide


@njit(cache=True, nogil=True)
def _bounds(
    s: Row, kind: int, origin: npt.NDArray[np.float64], cell: float, rows: int, columns: int
) -> tuple[int, int, int, int]:
    """Range of cells (i0, i1, j0, j1), ends included, that the solid's bounding box touches."""
    if kind == FRUSTUM:
        wide = max(s[7], s[7] + s[8] * s[6])
        ex, ey = s[0] + s[3] * s[6], s[1] + s[4] * s[6]
    else:
        wide = s[3] if kind == ELLIPSOID else math.hypot(s[3], s[4])
        ex, ey = s[0], s[1]
    i0 = math.floor((min(s[0], ex) - wide - origin[0]) / cell)
    i1 = math.floor((max(s[0], ex) + wide - origin[0]) / cell)
    j0 = math.floor((min(s[1], ey) - wide - origin[1]) / cell)
    j1 = math.floor((max(s[1], ey) + wide - origin[1]) / cell)
    return max(i0, 0), min(i1, columns - 1), max(j0, 0), min(j1, rows - 1)


@njit(cache=True, nogil=True)
def _kind(solid: int, frusta: int, ellipsoids: int) -> int:
    if solid < frusta:
        return FRUSTUM
    return ELLIPSOID if solid < frusta + ellipsoids else 2


@njit(cache=True, nogil=True)
def count_entries(
    solids: npt.NDArray[np.float32],
    kinds: tuple[int, int],
    origin: npt.NDArray[np.float64],
    cell: float,
    shape: tuple[int, int],
) -> npt.NDArray[np.int32]:
    """(rows * columns + 1): where each cell's entries begin."""
    rows, columns = shape
    start = np.zeros(rows * columns + 1, np.int32)
    for solid in range(solids.shape[0]):
        s, kind = solids[solid], _kind(solid, kinds[0], kinds[1])
        i0, i1, j0, j1 = _bounds(s, kind, origin, cell, rows, columns)
        for j in range(j0, j1 + 1):
            for i in range(i0, i1 + 1):
                low, high = _over(s, kind, origin[0] + i * cell, origin[1] + j * cell, cell)
                if low <= high:
                    start[j * columns + i + 1] += 1
    for place in range(rows * columns):
        start[place + 1] += start[place]
    return start


@njit(cache=True, nogil=True)
def fill_entries(
    solids: npt.NDArray[np.float32],
    kinds: tuple[int, int],
    origin: npt.NDArray[np.float64],
    cell: float,
    shape: tuple[int, int],
    start: npt.NDArray[np.int32],
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """Lowest and highest z (m, 2) and solid (m,) of each entry, by rising lowest z within a cell."""
    rows, columns = shape
    z, owner = np.empty((start[-1], 2), np.float32), np.empty(start[-1], np.int32)
    used = np.zeros(rows * columns, np.int32)
    for solid in range(solids.shape[0]):
        s, kind = solids[solid], _kind(solid, kinds[0], kinds[1])
        i0, i1, j0, j1 = _bounds(s, kind, origin, cell, rows, columns)
        for j in range(j0, j1 + 1):
            for i in range(i0, i1 + 1):
                low, high = _over(s, kind, origin[0] + i * cell, origin[1] + j * cell, cell)
                if low > high:
                    continue
                place = j * columns + i
                at = start[place] + used[place]
                while at > start[place] and z[at - 1, 0] > low:
                    z[at, 0], z[at, 1], owner[at] = z[at - 1, 0], z[at - 1, 1], owner[at - 1]
                    at -= 1
                z[at, 0], z[at, 1], owner[at] = low, high, solid
                used[place] += 1
    return z, owner
