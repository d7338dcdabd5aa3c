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

Floats = npt.NDArray[np.float32]
EMPTY = -1
SIDES = 4
BITS = 20
HALF = 1 << (BITS - 1)
FIELD = (1 << BITS) - 1
COUNT, MEAN, SEEN, BRIGHTEST, INTENSITY, SCATTER = 0, 1, 4, 5, 6, 7
DERIVED, VARIANCES, DIRECTIONS, VIEW = 13, 14, 17, 26
VOXEL = 32
"""Columns of a voxel: count, mean from its low corner, mean of the scans that its points are of, greatest and mean
intensity, scatter xx xy xz yy yz zz; then its shape: the count it was derived from, three variances ascending, their
directions row by row; then the mean of the horizontal unit vectors (x, y) from its points to the sensor. 128 bytes:
what a look-up waits for is memory, so all of it lies in two cache lines."""
THIN = 4.0
USED, REFUSED, CURSOR, FREE, SCAN = 0, 1, 2, 3, 4
ROUNDS = 6


class MapArrays(NamedTuple):
    """slots (places, 2): key and row of each place in the table. voxels (rows, VOXEL).

    free: stack of unused rows. numbers: rows used, voxels refused for lack of room, sweep cursor, height of the stack,
    the last scan taken in.
    """

    slots: npt.NDArray[np.int64]
    voxels: Floats
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


@njit(cache=True, nogil=True, inline="always")
def place(slots: npt.NDArray[np.int64], key: int) -> int:
    """Where a key is in the table, or where it would go."""
    mask = len(slots) - 1
    slot = scatter_slot(key, mask)
    while slots[slot, 0] != EMPTY and slots[slot, 0] != key:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, nogil=True)
def _settle(grid: MapArrays, slot: int, key: int) -> int:
    """A fresh row for a key at its empty place, -1 when there is no room."""
    numbers = grid.numbers
    if numbers[FREE] == 0:
        numbers[REFUSED] += 1
        return -1
    numbers[FREE] -= 1
    numbers[USED] += 1
    row = grid.free[numbers[FREE]]
    grid.slots[slot, 0] = key
    grid.slots[slot, 1] = row
    for k in range(VOXEL):
        grid.voxels[row, k] = 0.0
    return row


@njit(cache=True, nogil=True)
def remove(grid: MapArrays, slot: int) -> None:
    """Frees a place, and moves later ones back so that every probe still ends right (no tombstones)."""
    slots = grid.slots
    mask = len(slots) - 1
    grid.free[grid.numbers[FREE]] = slots[slot, 1]
    grid.numbers[FREE] += 1
    grid.numbers[USED] -= 1
    hole, probe = slot, slot
    while True:
        probe = (probe + 1) & mask
        if slots[probe, 0] == EMPTY:
            break
        home = scatter_slot(slots[probe, 0], mask)
        if ((probe - home) & mask) >= ((probe - hole) & mask):
            slots[hole, 0] = slots[probe, 0]
            slots[hole, 1] = slots[probe, 1]
            hole = probe
    slots[hole, 0] = EMPTY


@njit(cache=True, nogil=True)
def insert(
    grid: MapArrays,
    clusters: Doubles,
    rotation: Doubles,
    position: Doubles,
    sizes: Doubles,
    sides: int,
    most: int,
    scan: int,
) -> None:
    """Merges clusters (m, 12) of `base_link` into the voxels of every level, with Chan's update.

    sizes: (levels,) m. sides: 4, or 1 for none. most: points from which on a voxel keeps its shape.
    """
    slots, voxels = grid.slots, grid.voxels
    grid.numbers[SCAN] = scan
    levels, count = len(sizes), len(clusters)
    rows = np.empty((count, levels), np.int64)
    offsets = np.empty((count, levels, 3))
    views = np.empty((count, 2))
    for n in range(count):
        x, y, z = clusters[n, 1], clusters[n, 2], clusters[n, 3]
        mx = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + position[0]
        my = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + position[1]
        mz = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + position[2]
        dx, dy = mx - position[0], my - position[1]
        across = math.sqrt(dx * dx + dy * dy) + 1e-6
        views[n, 0], views[n, 1] = -dx / across, -dy / across
        sector = side(dx, dy) if sides > 1 else 0
        for level in range(levels):
            size = sizes[level]
            ix, iy, iz = math.floor(mx / size), math.floor(my / size), math.floor(mz / size)
            key = pack(ix, iy, iz, sector + SIDES * level)
            slot = place(slots, key)
            rows[n, level] = slots[slot, 1] if slots[slot, 0] == key else _settle(grid, slot, key)
            offsets[n, level, 0] = mx - ix * size
            offsets[n, level, 1] = my - iy * size
            offsets[n, level, 2] = mz - iz * size
    s = np.zeros(6)
    for n in range(count):
        points = clusters[n, 0]
        if points > 1.0:
            _turn(clusters, n, rotation, s)
        else:
            s[:] = 0.0
        for level in range(levels):
            row = rows[n, level]
            if row < 0:
                continue
            voxels[row, BRIGHTEST] = max(voxels[row, BRIGHTEST], clusters[n, 11])
            had = voxels[row, COUNT]
            if had >= most:
                continue
            part = points / (had + points)
            voxels[row, SEEN] += part * (scan - voxels[row, SEEN])
            voxels[row, VIEW] += part * (views[n, 0] - voxels[row, VIEW])
            voxels[row, VIEW + 1] += part * (views[n, 1] - voxels[row, VIEW + 1])
            cross = had * part
            dx = offsets[n, level, 0] - voxels[row, MEAN]
            dy = offsets[n, level, 1] - voxels[row, MEAN + 1]
            dz = offsets[n, level, 2] - voxels[row, MEAN + 2]
            voxels[row, SCATTER] += s[0] + cross * dx * dx
            voxels[row, SCATTER + 1] += s[1] + cross * dx * dy
            voxels[row, SCATTER + 2] += s[2] + cross * dx * dz
            voxels[row, SCATTER + 3] += s[3] + cross * dy * dy
            voxels[row, SCATTER + 4] += s[4] + cross * dy * dz
            voxels[row, SCATTER + 5] += s[5] + cross * dz * dz
            voxels[row, MEAN] += part * dx
            voxels[row, MEAN + 1] += part * dy
            voxels[row, MEAN + 2] += part * dz
            voxels[row, INTENSITY] += part * (clusters[n, 10] - voxels[row, INTENSITY])
            voxels[row, COUNT] = had + points


@njit(cache=True, nogil=True, inline="always")
def _turn(c: Doubles, n: int, r: Doubles, s: Doubles) -> None:
    """s = R S R^T of the scatter of a cluster, both as xx xy xz yy yz zz."""
    k = 0
    for i in range(3):
        ax = r[i, 0] * c[n, 4] + r[i, 1] * c[n, 5] + r[i, 2] * c[n, 6]
        ay = r[i, 0] * c[n, 5] + r[i, 1] * c[n, 7] + r[i, 2] * c[n, 8]
        az = r[i, 0] * c[n, 6] + r[i, 1] * c[n, 8] + r[i, 2] * c[n, 9]
        for j in range(i, 3):
            s[k] = ax * r[j, 0] + ay * r[j, 1] + az * r[j, 2]
            k += 1


@njit(cache=True, nogil=True)
def sweep(grid: MapArrays, centre: Doubles, sizes: Doubles, reach_m: float, scan: int, stale: int, places: int) -> None:
    """Looks at the next `places` of the table; forgets what is out of reach, and thin voxels not seen for `stale`."""
    mask = len(grid.slots) - 1
    slot = grid.numbers[CURSOR]
    left = places
    while left > 0:
        left -= 1
        key = grid.slots[slot, 0]
        if key != EMPTY:
            v = grid.voxels[grid.slots[slot, 1]]
            size = sizes[(key >> (3 * BITS)) // SIDES]
            dx = (((key >> (2 * BITS)) & FIELD) - HALF) * size - centre[0]
            dy = (((key >> BITS) & FIELD) - HALF) * size - centre[1]
            dz = ((key & FIELD) - HALF) * size - centre[2]
            far = dx * dx + dy * dy + dz * dz > reach_m * reach_m
            if far or (v[COUNT] < THIN and scan - v[SEEN] > stale):
                remove(grid, slot)
                continue  # another voxel may have moved here
        slot = (slot + 1) & mask
    grid.numbers[CURSOR] = slot


@njit(cache=True, nogil=True)
def derive(v: Floats, prior: float, extra: float) -> None:
    """Variances and directions of a voxel's scatter by Jacobi rotations, shrunk to `prior` (m^2) by `extra` points."""
    a, q = np.empty((3, 3)), np.eye(3)
    scale = 1.0 / v[COUNT]
    a[0, 0], a[0, 1], a[0, 2] = v[SCATTER] * scale, v[SCATTER + 1] * scale, v[SCATTER + 2] * scale
    a[1, 1], a[1, 2], a[2, 2] = v[SCATTER + 3] * scale, v[SCATTER + 4] * scale, v[SCATTER + 5] * scale
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
    v[DERIVED] = v[COUNT]
    weight = v[COUNT] / (v[COUNT] + extra)
    for k, column in enumerate((first, second, third)):
        v[VARIANCES + k] = weight * max(a[column, column], 0.0) + (1.0 - weight) * prior
        for i in range(3):
            v[DIRECTIONS + 3 * k + i] = q[i, column]


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
