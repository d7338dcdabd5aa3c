"""Residuals of a scan's clusters against the voxels, summed to normal equations of the pose.

A voxel's Gaussian decides by itself how much it constrains: its thinnest direction counts by how thin it is. One as
wide as the voxel is cut by it, says nothing about motion and is left out.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.odometry.map_kernels import (
    COUNT,
    DERIVED,
    DIRECTIONS,
    EMPTY,
    MEAN,
    SCAN,
    SEEN,
    SIDES,
    VARIANCES,
    VIEW,
    MapArrays,
    derive,
    pack,
    place,
    side,
)
from pipeline.odometry.so3 import Doubles


@njit(cache=True, nogil=True)
def match(
    grid: MapArrays,
    clusters: Doubles,
    rotation: Doubles,
    position: Doubles,
    sizes: Doubles,
    sides: int,
    first_level: int,
    settings: Doubles,
) -> tuple[Doubles, Doubles, Doubles]:
    """A (6, 6), b (6,) of attitude (body) and position; numbers (5,): matches, sum of d^2, sum of weights, directions,
    sum of what the voxels count by their age.

    The update is -A^-1 b. Levels before `first_level` are left out.
    settings: fewest points of a voxel, floor (m), Huber (sigmas), gate (sigmas), widest direction and prior variance
    as shares of the squared size, weight of the prior in points, most directions, scans after which a voxel counts in
    full, share of that which it counts before, how far (m) the middle of what is seen of a thing lies off its own.
    """
    a, b, numbers, h = np.zeros((6, 6)), np.zeros(6), np.zeros(5), np.empty(6)
    fewest, floor, huber, gate = settings[0], settings[1] ** 2, settings[2], settings[3] ** 2
    slots, voxels, directions = grid.slots, grid.voxels, int(settings[7])
    for n in range(len(clusters)):
        qx, qy, qz = clusters[n, 1], clusters[n, 2], clusters[n, 3]
        wx = rotation[0, 0] * qx + rotation[0, 1] * qy + rotation[0, 2] * qz + position[0]
        wy = rotation[1, 0] * qx + rotation[1, 1] * qy + rotation[1, 2] * qz + position[1]
        wz = rotation[2, 0] * qx + rotation[2, 1] * qy + rotation[2, 2] * qz + position[2]
        row, size, rx, ry, rz = np.int64(-1), 0.0, 0.0, 0.0, 0.0
        vx, vy = position[0] - wx, position[1] - wy
        across = math.sqrt(vx * vx + vy * vy) + 1e-6
        sector = side(-vx, -vy) if sides > 1 else 0
        for level in range(first_level, len(sizes)):
            size = sizes[level]
            ix, iy, iz = math.floor(wx / size), math.floor(wy / size), math.floor(wz / size)
            slot = place(slots, pack(ix, iy, iz, sector + SIDES * level))
            if slots[slot, 0] != EMPTY and voxels[slots[slot, 1], COUNT] >= fewest:
                row = slots[slot, 1]
                rx = wx - ix * size - voxels[row, MEAN]
                ry = wy - iy * size - voxels[row, MEAN + 1]
                rz = wz - iz * size - voxels[row, MEAN + 2]
                break
        if row < 0:
            continue
        # The part of a round thing that is seen has its middle off the thing's, towards the sensor: by `round` times
        # the mean cosine of the views, as seen from where the voxel was. From elsewhere that is less.
        mx, my = float(voxels[row, VIEW]), float(voxels[row, VIEW + 1])
        deeper = settings[10] * (1.0 - (mx * vx + my * vy) / (across * (mx * mx + my * my) + 1e-9))
        rx += deeper * mx
        ry += deeper * my
        if voxels[row, COUNT] > 1.2 * voxels[row, DERIVED]:
            derive(voxels[row], settings[5] * size * size, settings[6])
        share = 1.0 / clusters[n, 0] + 1.0 / voxels[row, COUNT]
        widest = settings[4] * size * size
        distance = 0.0
        for k in range(directions):
            variance = voxels[row, VARIANCES + k]
            if variance < widest:
                u = DIRECTIONS + 3 * k
                r = rx * voxels[row, u] + ry * voxels[row, u + 1] + rz * voxels[row, u + 2]
                distance += r * r / (variance * share + floor)
        if distance > gate:
            continue
        robust = 1.0 if distance <= huber * huber else huber / math.sqrt(distance)
        numbers[0] += 1.0
        numbers[1] += distance
        numbers[2] += robust
        age = grid.numbers[SCAN] - voxels[row, SEEN]
        settled = max(settings[9], min(1.0, age / settings[8]))
        numbers[4] += settled
        for k in range(directions):
            variance = voxels[row, VARIANCES + k]
            if variance >= widest:
                break
            u = DIRECTIONS + 3 * k
            ux, uy, uz = float(voxels[row, u]), float(voxels[row, u + 1]), float(voxels[row, u + 2])
            weight = settled * robust * (1.0 - variance / widest) / (variance * share + floor)
            r = rx * ux + ry * uy + rz * uz
            # h = (q x R^T u, u): derivative of u . (R Exp(th) q + p).
            bx = rotation[0, 0] * ux + rotation[1, 0] * uy + rotation[2, 0] * uz
            by = rotation[0, 1] * ux + rotation[1, 1] * uy + rotation[2, 1] * uz
            bz = rotation[0, 2] * ux + rotation[1, 2] * uy + rotation[2, 2] * uz
            h[0], h[1], h[2] = qy * bz - qz * by, qz * bx - qx * bz, qx * by - qy * bx
            h[3], h[4], h[5] = ux, uy, uz
            for i in range(6):
                wh = weight * h[i]
                b[i] += wh * r
                for j in range(i, 6):
                    a[i, j] += wh * h[j]
            numbers[3] += 1.0
    for i in range(6):
        for j in range(i):
            a[i, j] = a[j, i]
    return a, b, numbers
