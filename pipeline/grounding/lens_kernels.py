"""Points to pixels, and which of them the image shows: projection, depth image, visibility."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Doubles = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
LENS = 11
"""Numbers of a lens: fx, fy, cx, cy, 1 for fisheye, five of distortion, tangent of the widest angle."""
MOST_CELLS = 5
"""A splat reaches so many cells to each side."""


@njit(cache=True, nogil=True)
def look(
    points: Doubles, rotation: Doubles, position: Doubles, lens: Doubles, size: Doubles, ranges: Doubles
) -> Floats:
    """(n, 3) u, v (pixels) and range (m) of points (n, 3); range 0 where the image (width, height) does not show them.

    rotation (3, 3), position (3,): optical frame in that of the points. ranges: nearest and farthest. Lens models as
    OpenCV's: Brown (1966) with k1 k2 p1 p2 k3, Kannala and Brandt (2006) with k1 to k4.
    """
    out = np.zeros((len(points), 3), np.float32)
    fx, fy, cx, cy, fisheye = lens[0], lens[1], lens[2], lens[3], lens[4] > 0.0
    a, b, c, d, e, widest = lens[5], lens[6], lens[7], lens[8], lens[9], lens[10]
    for n in range(len(points)):
        dx, dy, dz = points[n, 0] - position[0], points[n, 1] - position[1], points[n, 2] - position[2]
        square = dx * dx + dy * dy + dz * dz
        if square > ranges[1] * ranges[1] or square < ranges[0] * ranges[0]:
            continue
        z = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
        if z <= 0.05:
            continue
        x = (rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz) / z
        y = (rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz) / z
        r2 = x * x + y * y
        if r2 > widest * widest:
            continue
        if fisheye:
            r = math.sqrt(r2)
            t = math.atan(r)
            t2 = t * t
            scale = t * (1.0 + t2 * (a + t2 * (b + t2 * (c + t2 * d)))) / r if r > 1e-9 else 1.0
            x, y = x * scale, y * scale
        else:
            radial = 1.0 + r2 * (a + r2 * (b + r2 * e))
            x, y = (
                x * radial + 2.0 * c * x * y + d * (r2 + 2.0 * x * x),
                y * radial + c * (r2 + 2.0 * y * y) + 2.0 * d * x * y,
            )
        u, v = fx * x + cx, fy * y + cy
        if -0.5 < u < size[0] - 0.5 and -0.5 < v < size[1] - 0.5:
            out[n, 0], out[n, 1], out[n, 2] = u, v, math.sqrt(square)
    return out


@njit(cache=True, nogil=True)
def splat(seen: Floats, cell_px: float, reach_px_m: float, depth: Floats) -> None:
    """Least range of each cell (rows, cols) of a depth image that holds infinity where nothing is.

    A point at range r covers reach_px_m / r pixels to each side.
    """
    rows, cols = depth.shape
    for n in range(len(seen)):
        r = seen[n, 2]
        if r <= 0.0:
            continue
        row, col = int((seen[n, 1] + 0.5) / cell_px), int((seen[n, 0] + 0.5) / cell_px)
        half = min(int(reach_px_m / (r * cell_px)), MOST_CELLS)
        for i in range(max(row - half, 0), min(row + half + 1, rows)):
            for j in range(max(col - half, 0), min(col + half + 1, cols)):
                depth[i, j] = min(depth[i, j], r)


@njit(cache=True, nogil=True)
def unhidden(seen: Floats, cell_px: float, behind_m: float, depth: Floats) -> npt.NDArray[np.bool_]:
    """(n,) which of the points seen stand at the front of their cell, or `behind_m` and 2 % behind it."""
    rows, cols = depth.shape
    out = np.zeros(len(seen), np.bool_)
    for n in range(len(seen)):
        r = seen[n, 2]
        if r > 0.0:
            row = min(int((seen[n, 1] + 0.5) / cell_px), rows - 1)
            col = min(int((seen[n, 0] + 0.5) / cell_px), cols - 1)
            out[n] = r <= depth[row, col] * 1.02 + behind_m
    return out
