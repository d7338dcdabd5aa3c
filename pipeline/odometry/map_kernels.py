"""The voxel map as arrays: a hash table with open addressing over rows of running statistics.

Coordinates of a voxel and its level are packed into one integer. All work is O(1) a voxel, whatever the ride's length.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from pipeline.odometry.so3 import Doubles

EMPTY = -1
SIDES = 4
HALF = 1 << 19
FIELD = (1 << 20) - 1
COUNT, MEAN, SCATTER, INTENSITY, BRIGHTEST = 0, 1, 4, 10, 11
STATISTICS = 12
SHAPE = 13
"""Columns of a shape: count when it was derived, three variances ascending, their directions row by row."""
USED, REFUSED, CURSOR, FREE = 0, 1, 2, 3
ROUNDS = 6


class MapArrays(NamedTuple):
    """slots: key and row of each place in the table. rows: statistics, shape, key, and the scan that saw it last.

    free: stack of unused rows. numbers: rows used, voxels refused for lack of room, sweep cursor, height of the stack.
    """

    keys: npt.NDArray[np.int64]
    rows: npt.NDArray[np.int32]
    statistics: Doubles
    shape: npt.NDArray[np.float32]
    seen: npt.NDArray[np.int32]
    free: npt.NDArray[np.int32]
    numbers: npt.NDArray[np.int64]


@njit(cache=True, nogil=True, inline="always")
def pack(x: int, y: int, z: int, level: int) -> int:
    """20 bits a coordinate, and level and side: 157 km of 0.3 m voxels before coordinates repeat."""
    return (level << 60) | ((x + HALF) & FIELD) << 40 | ((y + HALF) & FIELD) << 20 | ((z + HALF) & FIELD)


@njit(cache=True, nogil=True, inline="always")
def side(dx: float, dy: float) -> int:
    """Which of the four sides a thing is seen from, by the way from the sensor to it.

    Each side of a voxel is a voxel of its own. A stem or a crown shows its near side first: with one Gaussian for all
    sides the mean creeps on with the sensor, and every way comes out short (0.16 % in an open forest, 0.06 % so).
    """
    return (1 if dx > 0.0 else 0) + (2 if dy > 0.0 else 0)


@njit(cache=True, nogil=True, inline="always")
def scatter_slot(key: int, mask: int) -> np.int64:
    """First place of a key in a table of mask + 1 places: the finaliser of MurmurHash3."""
    h = np.uint64(key)
    h ^= h >> np.uint64(33)
    h *= np.uint64(0xFF51AFD7ED558CCD)
    h ^= h >> np.uint64(33)
    return np.int64(h & np.uint64(mask))


@njit(cache=True, nogil=True)
def find(keys: npt.NDArray[np.int64], key: int) -> int:
    """Place of a key, or -1."""
    mask = len(keys) - 1
    slot = scatter_slot(key, mask)
    while keys[slot] != EMPTY:
        if keys[slot] == key:
            return slot
        slot = (slot + 1) & mask
    return -1


@njit(cache=True, nogil=True)
def claim(voxels: MapArrays, key: int) -> int:
    """Row of a key, a new one where it was not there, -1 when there is no room."""
    mask = len(voxels.keys) - 1
    slot = scatter_slot(key, mask)
    while voxels.keys[slot] != EMPTY:
        if voxels.keys[slot] == key:
            return voxels.rows[slot]
        slot = (slot + 1) & mask
    if voxels.numbers[FREE] == 0:
        voxels.numbers[REFUSED] += 1
        return -1
    voxels.numbers[FREE] -= 1
    voxels.numbers[USED] += 1
    row = voxels.free[voxels.numbers[FREE]]
    voxels.keys[slot] = key
    voxels.rows[slot] = row
    voxels.statistics[row, :] = 0.0
    voxels.shape[row, 0] = 0.0
    return row


@njit(cache=True, nogil=True)
def remove(voxels: MapArrays, slot: int) -> None:
    """Frees a place, and moves later ones back so that every probe still ends right (no tombstones)."""
    mask = len(voxels.keys) - 1
    voxels.free[voxels.numbers[FREE]] = voxels.rows[slot]
    voxels.numbers[FREE] += 1
    voxels.numbers[USED] -= 1
    hole, probe = slot, slot
    while True:
        probe = (probe + 1) & mask
        if voxels.keys[probe] == EMPTY:
            break
        home = scatter_slot(voxels.keys[probe], mask)
        if ((probe - home) & mask) >= ((probe - hole) & mask):
            voxels.keys[hole] = voxels.keys[probe]
            voxels.rows[hole] = voxels.rows[probe]
            hole = probe
    voxels.keys[hole] = EMPTY


@njit(cache=True, nogil=True)
def insert(
    voxels: MapArrays,
    clusters: Doubles,
    rotation: Doubles,
    position: Doubles,
    sizes: Doubles,
    most: float,
    scan: int,
) -> None:
    """Merges clusters (m, 12) of `base_link` into the voxels of every level; sizes (levels,) in m. Chan's update."""
    s = np.empty((3, 3))
    for n in range(len(clusters)):
        c = clusters[n]
        mx = rotation[0, 0] * c[1] + rotation[0, 1] * c[2] + rotation[0, 2] * c[3] + position[0]
        my = rotation[1, 0] * c[1] + rotation[1, 1] * c[2] + rotation[1, 2] * c[3] + position[1]
        mz = rotation[2, 0] * c[1] + rotation[2, 1] * c[2] + rotation[2, 2] * c[3] + position[2]
        turned = False
        sector = side(mx - position[0], my - position[1])
        for level in range(len(sizes)):
            scale = 1.0 / sizes[level]
            row = claim(
                voxels,
                pack(math.floor(mx * scale), math.floor(my * scale), math.floor(mz * scale), sector + SIDES * level),
            )
            if row < 0:
                continue
            v = voxels.statistics[row]
            voxels.seen[row] = scan
            v[BRIGHTEST] = max(v[BRIGHTEST], c[11])
            if v[COUNT] >= most:
                continue
            if not turned:
                _turn(c, rotation, s)
                turned = True
            total = v[COUNT] + c[0]
            part = c[0] / total
            cross = v[COUNT] * part
            dx, dy, dz = mx - v[1], my - v[2], mz - v[3]
            v[4] += s[0, 0] + cross * dx * dx
            v[5] += s[0, 1] + cross * dx * dy
            v[6] += s[0, 2] + cross * dx * dz
            v[7] += s[1, 1] + cross * dy * dy
            v[8] += s[1, 2] + cross * dy * dz
            v[9] += s[2, 2] + cross * dz * dz
            v[1] += part * dx
            v[2] += part * dy
            v[3] += part * dz
            v[INTENSITY] += part * (c[10] - v[INTENSITY])
            v[COUNT] = total


@njit(cache=True, nogil=True)
def _turn(c: Doubles, r: Doubles, s: Doubles) -> None:
    """s = R S R^T of the scatter of a cluster."""
    for i in range(3):
        ax = r[i, 0] * c[4] + r[i, 1] * c[5] + r[i, 2] * c[6]
        ay = r[i, 0] * c[5] + r[i, 1] * c[7] + r[i, 2] * c[8]
        az = r[i, 0] * c[6] + r[i, 1] * c[8] + r[i, 2] * c[9]
        for j in range(3):
            s[i, j] = ax * r[j, 0] + ay * r[j, 1] + az * r[j, 2]


@njit(cache=True, nogil=True)
def sweep(voxels: MapArrays, centre: Doubles, reach_m: float, scan: int, stale: int, places: int) -> None:
    """Looks at the next `places` of the table; forgets what is out of reach, and thin voxels not seen for `stale`."""
    mask = len(voxels.keys) - 1
    slot = voxels.numbers[CURSOR]
    left = places
    while left > 0:
        left -= 1
        if voxels.keys[slot] != EMPTY:
            row = voxels.rows[slot]
            v = voxels.statistics[row]
            dx, dy, dz = v[1] - centre[0], v[2] - centre[1], v[3] - centre[2]
            far = dx * dx + dy * dy + dz * dz > reach_m * reach_m
            if far or (v[COUNT] < 4.0 and scan - voxels.seen[row] > stale):
                remove(voxels, slot)
                continue  # another voxel may have moved here
        slot = (slot + 1) & mask
    voxels.numbers[CURSOR] = slot


@njit(cache=True, nogil=True)
def derive(shape: npt.NDArray[np.float32], v: Doubles, prior: float, extra: float) -> None:
    """Variances and directions of a voxel's scatter by Jacobi rotations, shrunk to `prior` (m^2) by `extra` points."""
    a, q = np.empty((3, 3)), np.eye(3)
    scale = 1.0 / v[COUNT]
    a[0, 0], a[0, 1], a[0, 2] = v[4] * scale, v[5] * scale, v[6] * scale
    a[1, 1], a[1, 2], a[2, 2] = v[7] * scale, v[8] * scale, v[9] * scale
    for _ in range(ROUNDS):
        if abs(a[0, 1]) + abs(a[0, 2]) + abs(a[1, 2]) < 1e-9:
            break
        for i in range(2):
            for j in range(i + 1, 3):
                _rotate(a, q, i, j)
    first, second, third = 0, 1, 2
    if a[second, second] < a[first, first]:
        first, second = second, first
    if a[third, third] < a[second, second]:
        second, third = third, second
        if a[second, second] < a[first, first]:
            first, second = second, first
    shape[0] = v[COUNT]
    weight = v[COUNT] / (v[COUNT] + extra)
    for k, column in enumerate((first, second, third)):
        shape[1 + k] = weight * max(a[column, column], 0.0) + (1.0 - weight) * prior
        for i in range(3):
            shape[4 + 3 * k + i] = q[i, column]


@njit(cache=True, nogil=True, inline="always")
def _rotate(a: Doubles, q: Doubles, i: int, j: int) -> None:
    """One Jacobi rotation; only the upper triangle of a is kept."""
    if a[i, j] == 0.0:
        return
    theta = 0.5 * (a[j, j] - a[i, i]) / a[i, j]
    sign = 1.0 if theta >= 0.0 else -1.0
    t = sign / (abs(theta) + math.sqrt(theta * theta + 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    k = 3 - i - j
    a[i, i] -= t * a[i, j]
    a[j, j] += t * a[i, j]
    a[i, j] = 0.0
    ki0, ki1 = min(k, i), max(k, i)
    kj0, kj1 = min(k, j), max(k, j)
    aki, akj = a[ki0, ki1], a[kj0, kj1]
    a[ki0, ki1] = c * aki - s * akj
    a[kj0, kj1] = s * aki + c * akj
    for m in range(3):
        qi, qj = q[m, i], q[m, j]
        q[m, i] = c * qi - s * qj
        q[m, j] = s * qi + c * qj
