"""Residuals of a scan's clusters against the voxels, summed to normal equations of the pose.

A voxel's Gaussian decides by itself what it constrains: a plane one direction, a thin stem two, a twig three.
A direction as wide as the voxel is cut by it, says nothing about motion and is left out.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.odometry.map_kernels import COUNT, SIDES, MapArrays, derive, find, pack, side
from pipeline.odometry.so3 import Doubles


@njit(cache=True, nogil=True)
def match(
    voxels: MapArrays,
    clusters: Doubles,
    rotation: Doubles,
    position: Doubles,
    sizes: Doubles,
    first_level: int,
    settings: Doubles,
) -> tuple[Doubles, Doubles, Doubles]:
    """A (6, 6), b (6,) of attitude (body) and position; numbers (4,): matches, sum of d^2, sum of weights, directions.

    The update is -A^-1 b. Levels before `first_level` are left out.
    settings: fewest points of a voxel, floor (m), Huber (sigmas), gate (sigmas), widest direction and prior variance
    as shares of the squared size, weight of the prior in points.
    """
    a, b, numbers = np.zeros((6, 6)), np.zeros(6), np.zeros(4)
    fewest, floor, huber, gate = settings[0], settings[1] ** 2, settings[2], settings[3] ** 2
    h = np.empty(6)
    for n in range(len(clusters)):
        c = clusters[n]
        qx, qy, qz = c[1], c[2], c[3]
        wx = rotation[0, 0] * qx + rotation[0, 1] * qy + rotation[0, 2] * qz + position[0]
        wy = rotation[1, 0] * qx + rotation[1, 1] * qy + rotation[1, 2] * qz + position[1]
        wz = rotation[2, 0] * qx + rotation[2, 1] * qy + rotation[2, 2] * qz + position[2]
        row, size = -1, 0.0
        sector = side(wx - position[0], wy - position[1])
        for level in range(first_level, len(sizes)):
            size = sizes[level]
            scale = 1.0 / size
            slot = find(
                voxels.keys,
                pack(math.floor(wx * scale), math.floor(wy * scale), math.floor(wz * scale), sector + SIDES * level),
            )
            if slot >= 0 and voxels.statistics[voxels.rows[slot], COUNT] >= fewest:
                row = voxels.rows[slot]
                break
        if row < 0:
            continue
        v, shape = voxels.statistics[row], voxels.shape[row]
        if v[COUNT] > 1.2 * shape[0]:
            derive(shape, v, settings[5] * size * size, settings[6])
        rx, ry, rz = wx - v[1], wy - v[2], wz - v[3]
        share = 1.0 / c[0] + 1.0 / v[COUNT]
        widest = settings[4] * size * size
        distance = 0.0
        for k in range(3):
            variance = shape[1 + k]
            if variance < widest:
                r = rx * shape[4 + 3 * k] + ry * shape[5 + 3 * k] + rz * shape[6 + 3 * k]
                distance += r * r / (variance * share + floor)
        if distance > gate:
            continue
        robust = 1.0 if distance <= huber * huber else huber / math.sqrt(distance)
        numbers[0] += 1.0
        numbers[1] += distance
        numbers[2] += robust
        for k in range(3):
            variance = shape[1 + k]
            if variance >= widest:
                break
            ux, uy, uz = float(shape[4 + 3 * k]), float(shape[5 + 3 * k]), float(shape[6 + 3 * k])
            weight = robust * (1.0 - variance / widest) / (variance * share + floor)
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
