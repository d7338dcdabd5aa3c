"""The lowest points of each cell, and the mean of what lies on the ground."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def keep_lowest(lowest: Floats, count: npt.NDArray[np.int64], points: Floats, low: Doubles, cell_m: float) -> None:
    """lowest (nx, ny, k): the k lowest heights of a cell, ascending, infinite where there are fewer. low: (2,)."""
    nx, ny, ranks = lowest.shape
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        if not math.isfinite(x + y + z):
            continue
        i, j = int((x - low[0]) / cell_m), int((y - low[1]) / cell_m)
        if i < 0 or j < 0 or i >= nx or j >= ny:
            continue
        count[i, j] += 1
        k = ranks - 1
        if z >= lowest[i, j, k]:
            continue
        while k > 0 and lowest[i, j, k - 1] > z:
            lowest[i, j, k] = lowest[i, j, k - 1]
            k -= 1
        lowest[i, j, k] = z


@njit(cache=True, nogil=True)
def keep_highest(highest: Floats, points: Floats, low: Doubles, cell_m: float) -> None:
    """highest (nx, ny, k): the k greatest heights of a cell, descending, minus infinity where there are fewer."""
    nx, ny, ranks = highest.shape
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        if not math.isfinite(x + y + z):
            continue
        i, j = int((x - low[0]) / cell_m), int((y - low[1]) / cell_m)
        if i < 0 or j < 0 or i >= nx or j >= ny:
            continue
        k = ranks - 1
        if z <= highest[i, j, k]:
            continue
        while k > 0 and highest[i, j, k - 1] < z:
            highest[i, j, k] = highest[i, j, k - 1]
            k -= 1
        highest[i, j, k] = z


@njit(cache=True, nogil=True)
def heights(points: Floats, ground: Doubles, low: Doubles, cell_m: float) -> Floats:
    """(n,) height of points (n, 3) above a ground (nx, ny) given at the middles of cells, bilinear."""
    nx, ny = ground.shape
    out = np.empty(len(points), np.float32)
    for n in range(len(points)):
        u = min(max((points[n, 0] - low[0]) / cell_m - 0.5, 0.0), nx - 1.0)
        v = min(max((points[n, 1] - low[1]) / cell_m - 0.5, 0.0), ny - 1.0)
        if not math.isfinite(u + v):
            out[n] = np.nan
            continue
        i, j = min(int(u), max(nx - 2, 0)), min(int(v), max(ny - 2, 0))
        k, m = min(i + 1, nx - 1), min(j + 1, ny - 1)
        f, g = u - i, v - j
        near = ground[i, j] * (1.0 - g) + ground[i, m] * g
        far = ground[k, j] * (1.0 - g) + ground[k, m] * g
        out[n] = points[n, 2] - (near * (1.0 - f) + far * f)
    return out


@njit(cache=True, nogil=True)
def add_near(total: Doubles, count: npt.NDArray[np.int64], points: Floats, height: Floats, *, low: Doubles,
             cell_m: float, below_m: float, above_m: float) -> None:  # fmt: skip
    """Adds the heights of those points that lie between `below_m` and `above_m` of a first ground, by cell."""
    nx, ny = total.shape
    for n in range(len(points)):
        if not below_m < height[n] < above_m:
            continue
        i, j = int((points[n, 0] - low[0]) / cell_m), int((points[n, 1] - low[1]) / cell_m)
        if 0 <= i < nx and 0 <= j < ny:
            total[i, j] += height[n]
            count[i, j] += 1
