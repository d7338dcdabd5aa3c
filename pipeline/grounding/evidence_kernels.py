"""Evidence by voxel: a hash table that grows, with log-odds, times seen and times in a box."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

EMPTY = np.iinfo(np.int64).min
HALF = 1 << 20
FIELD = (1 << 21) - 1
VOXEL = np.dtype([("log_odds", "<f4"), ("seen", "<u2"), ("hits", "<u2"), ("last", "<i4")])


@njit(cache=True, nogil=True, inline="always")
def key_of(x: float, y: float, z: float, scale: float) -> int:
    """21 bits an axis."""
    i, j, k = math.floor(x * scale), math.floor(y * scale), math.floor(z * scale)
    return ((i + HALF) & FIELD) << 42 | ((j + HALF) & FIELD) << 21 | ((k + HALF) & FIELD)


@njit(cache=True, nogil=True, inline="always")
def place(keys: npt.NDArray[np.int64], key: int) -> int:
    """Where a key is in the table, or where it would go: the finaliser of MurmurHash3."""
    mask = np.uint64(len(keys) - 1)
    h = np.uint64(key)
    h ^= h >> np.uint64(33)
    h *= np.uint64(0xFF51AFD7ED558CCD)
    h ^= h >> np.uint64(33)
    slot = np.int64(h & mask)
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = (slot + 1) & np.int64(mask)
    return int(slot)


@njit(cache=True, nogil=True)
def add(
    keys: npt.NDArray[np.int64],
    voxels: npt.NDArray[np.void],
    points: npt.NDArray[np.float64],
    change: npt.NDArray[np.float32],
    scale: float,
    view: int,
    most: float,
) -> int:
    """Adds a view's evidence: of the points (n, 3) of one voxel the strongest word counts, once. New voxels made.

    change: (n,) log-odds; NaN says nothing. The table must have room for n more.
    """
    made = 0
    for n in range(len(points)):
        if math.isnan(change[n]):
            continue
        key = key_of(points[n, 0], points[n, 1], points[n, 2], scale)
        slot = place(keys, key)
        if keys[slot] == EMPTY:
            keys[slot] = key
            voxels[slot].log_odds = 0.0
            voxels[slot].seen = 0
            voxels[slot].hits = 0
            voxels[slot].last = -1
            made += 1
        v = voxels[slot]
        if v.last == view:
            continue
        v.last = view
        v.log_odds = min(max(v.log_odds + change[n], -most), most)
        if v.seen < 65535:
            v.seen += 1
            v.hits += 1 if change[n] > 0.0 else 0
    return made


@njit(cache=True, nogil=True)
def rehash(
    keys: npt.NDArray[np.int64],
    voxels: npt.NDArray[np.void],
    into_keys: npt.NDArray[np.int64],
    into: npt.NDArray[np.void],
) -> None:
    """Everything into a larger table."""
    for n in range(len(keys)):
        if keys[n] != EMPTY:
            slot = place(into_keys, keys[n])
            into_keys[slot] = keys[n]
            into[slot] = voxels[n]


@njit(cache=True, nogil=True)
def find(
    keys: npt.NDArray[np.int64], points: npt.NDArray[np.float64], scale: float, out: npt.NDArray[np.int64]
) -> None:
    """out (n,): slot of the voxel of each point (n, 3), -1 where nothing is known."""
    for n in range(len(points)):
        key = key_of(points[n, 0], points[n, 1], points[n, 2], scale)
        slot = place(keys, key)
        out[n] = slot if keys[slot] == key else -1
