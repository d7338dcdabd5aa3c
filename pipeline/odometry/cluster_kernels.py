"""A scan as clusters: the points of one small cell of `odom` become a count, a mean and a scatter.

For a fixed voxel of the map, the cost of all points of a cluster is that of its mean, times the count: nothing is lost.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from pipeline.odometry.map_kernels import EMPTY, pack, scatter_slot
from pipeline.odometry.so3 import Doubles

CLUSTER = 12
"""Columns: count, mean (base_link), scatter xx xy xz yy yz zz, mean and greatest intensity."""


@njit(cache=True, nogil=True)
def cluster(
    points: Doubles,
    intensity: npt.NDArray[np.uint8],
    rotation: Doubles,
    position: Doubles,
    leaf_m: float,
    slots: npt.NDArray[np.int64],
    owners: npt.NDArray[np.int32],
) -> Doubles:
    """Clusters (m, CLUSTER) of points (n, 3) in `base_link`, cells of `leaf_m` in `odom` under the given pose.

    slots, owners: scratch of a power of two, more than twice n. Order of first appearance.
    """
    slots[:] = EMPTY
    out = np.zeros((len(points), CLUSTER))
    found = 0
    scale = 1.0 / leaf_m
    mask = len(slots) - 1
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        wx = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + position[0]
        wy = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + position[1]
        wz = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + position[2]
        key = pack(math.floor(wx * scale), math.floor(wy * scale), math.floor(wz * scale), 0)
        slot = scatter_slot(key, mask)
        while slots[slot] != EMPTY and slots[slot] != key:
            slot = (slot + 1) & mask
        if slots[slot] == EMPTY:
            slots[slot] = key
            owners[slot] = found
            found += 1
        c = out[owners[slot]]
        c[0] += 1.0
        part = 1.0 / c[0]
        dx, dy, dz = x - c[1], y - c[2], z - c[3]
        c[1] += dx * part
        c[2] += dy * part
        c[3] += dz * part
        ex, ey, ez = x - c[1], y - c[2], z - c[3]
        c[4] += dx * ex
        c[5] += dx * ey
        c[6] += dx * ez
        c[7] += dy * ey
        c[8] += dy * ez
        c[9] += dz * ez
        c[10] += (intensity[n] - c[10]) * part
        c[11] = max(c[11], float(intensity[n]))
    return out[:found].copy()
