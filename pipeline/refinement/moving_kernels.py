"""Rays through cells: which of those that were hit for a moment were looked through before or after."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Doubles = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
SHORT_M = 0.3
"""A ray tells nothing of what is nearer to its end."""


@njit(cache=True, nogil=True)
def hit(cells: npt.NDArray[np.int64], times_ms: Ints, first: Ints, last: Ints, count: Ints) -> None:
    """Cells (n,) hit at times (n,): when first, when last, and how often, each flat over all cells; count from 0."""
    for k in range(len(cells)):
        c = cells[k]
        if count[c] == 0 or times_ms[k] < first[c]:
            first[c] = times_ms[k]
        if count[c] == 0 or times_ms[k] > last[c]:
            last[c] = times_ms[k]
        count[c] += 1


@njit(cache=True, nogil=True)
def look_through(
    begins: Doubles,
    ends: Doubles,
    times_ms: Ints,
    low: Doubles,
    cell: float,
    shape: tuple[int, int, int],
    spans: Ints,
    around_ms: int,
    seen: Ints,
) -> None:
    """Rays (n, 3) at times (n,), through the cells of a box. spans: (cells, 2) first and last time that a cell is asked
    about was hit; of the others the first is after the last. seen: (cells, 3) adds up rays at other times, moments of
    these, and rays in between; moments are those of rays in order of time."""
    moment = np.full(len(spans), -(1 << 30), np.int32)
    index, step, crossing, every = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3), np.zeros(3)
    for k in range(len(begins)):
        until = _entered(begins[k], ends[k], low, cell, shape, index, step, crossing, every)
        inside = until > 0.0
        while inside:
            c = (index[0] * shape[1] + index[1]) * shape[2] + index[2]
            if spans[c, 0] <= spans[c, 1]:
                if spans[c, 0] <= times_ms[k] <= spans[c, 1]:
                    seen[c, 2] += 1
                elif times_ms[k] < spans[c, 0] - around_ms or times_ms[k] > spans[c, 1] + around_ms:
                    seen[c, 0] += 1
                    if abs(times_ms[k] - moment[c]) > 50:
                        moment[c] = times_ms[k]
                        seen[c, 1] += 1
            axis = 0
            if crossing[1] < crossing[axis]:
                axis = 1
            if crossing[2] < crossing[axis]:
                axis = 2
            inside = crossing[axis] < until
            index[axis] += step[axis]
            crossing[axis] += every[axis]
            inside = inside and 0 <= index[axis] < shape[axis]


@njit(cache=True, nogil=True)
def _entered(
    begin: Doubles,
    end: Doubles,
    low: Doubles,
    cell: float,
    shape: tuple[int, int, int],
    index: npt.NDArray[np.int64],
    step: npt.NDArray[np.int64],
    crossing: Doubles,
    every: Doubles,
) -> float:
    """Where a ray enters the box, for Amanatides and Woo (1987): how far it goes along itself, in metres, or 0 where it
    misses the box. Written are, for each axis (3,): the cell, the way it steps, where it next crosses, and from one
    crossing to the next."""
    dx, dy, dz = end[0] - begin[0], end[1] - begin[1], end[2] - begin[2]
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    start, until = 0.0, length - SHORT_M
    if until <= 0.0:
        return 0.0
    for axis in range(3):
        along = (end[axis] - begin[axis]) / length
        high = low[axis] + shape[axis] * cell
        if abs(along) < 1e-9:
            if not low[axis] <= begin[axis] < high:
                return 0.0
            continue
        one, two = (low[axis] - begin[axis]) / along, (high - begin[axis]) / along
        start, until = max(start, min(one, two)), min(until, max(one, two))
        if start >= until:
            return 0.0
    for axis in range(3):
        along = (end[axis] - begin[axis]) / length
        at = (begin[axis] + (start + 1e-6) * along - low[axis]) / cell
        index[axis] = min(max(int(math.floor(at)), 0), shape[axis] - 1)
        step[axis], crossing[axis], every[axis] = 0, np.inf, np.inf
        if abs(along) >= 1e-9:
            step[axis] = 1 if along > 0.0 else -1
            border = low[axis] + (index[axis] + (1 if along > 0.0 else 0)) * cell
            crossing[axis] = (border - begin[axis]) / along
            every[axis] = cell / abs(along)
    return until
