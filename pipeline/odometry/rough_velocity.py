"""A first velocity from scans alone: the shift at which scans of some tenths of a second apart overlap most.

The gyro knows how they are turned to each other, so three numbers are left, and all of them can be tried. A local
search would not do: in a grove every false match pulls it to standstill.
"""

from __future__ import annotations

import numpy as np

from pipeline.odometry.errors import TRIED, StartRefused
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.vote_kernels import votes

CELL_M = 0.3
HALF_M, HALF_UP_M = 30.0, 9.0
APART = 3
FASTEST_M_S, FASTEST_UP_M_S = 16.0, 4.0
MOST_CELLS = 1500
"""Of a scan are tried, each against all of another: enough to stand out, in a third of the time."""
DISTINCT = 4.0
"""Peak above the mean of all shifts, in their standard deviations."""


def rough_velocity(clouds: list[Doubles], times_s: Doubles) -> Doubles:
    """Velocity (3,) from clouds, each (n, 3) in axes that do not turn, from its own origin; times of these (k,).

    Good to about `CELL_M` over the time between. StartRefused when no shift stands out.
    """
    if len(clouds) <= APART:
        raise StartRefused(f"{len(clouds)} scans are too few to see the motion")
    apart_s = float(np.median(times_s[APART:] - times_s[:-APART]))
    across, up = int(FASTEST_M_S * apart_s / CELL_M), int(np.ceil(FASTEST_UP_M_S * apart_s / CELL_M))
    total = np.zeros((2 * across + 1, 2 * across + 1, 2 * up + 1))
    for first in range(0, len(clouds) - APART, 2):
        size = (*(2 * int(HALF_M / CELL_M),) * 2, 2 * int(HALF_UP_M / CELL_M))
        occupied = np.zeros(size, np.bool_)
        occupied[tuple(_cells(clouds[first]).T)] = True
        cells = _cells(clouds[first + APART])
        some = np.ascontiguousarray(cells[:: -(-len(cells) // MOST_CELLS) or 1])
        total += votes(occupied, some, across, up)
    peak = np.unravel_index(int(total.argmax()), total.shape)
    if total[peak] <= total.mean() + DISTINCT * total.std():
        raise StartRefused("the scans overlap as well at one speed as at another: nothing upright in view", TRIED)
    return (_centre(total, peak) - (across, across, up)) * CELL_M / apart_s


def _cells(cloud: Doubles) -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
    """The cells (m, 3) that hold a point, each once."""
    cells = np.floor((cloud + np.array([HALF_M, HALF_M, HALF_UP_M])) / CELL_M).astype(np.int32)
    limit = (2 * int(HALF_M / CELL_M), 2 * int(HALF_M / CELL_M), 2 * int(HALF_UP_M / CELL_M))
    return np.unique(cells[((cells >= 0) & (cells < limit)).all(axis=1)], axis=0)


def _centre(total: Doubles, peak: tuple[np.intp, ...]) -> Doubles:
    """The peak to a part of a cell: the mean of it and its neighbours, weighted with what they have above the least."""
    low = [max(int(p) - 1, 0) for p in peak]
    around = total[tuple(slice(a, a + 3) for a in low)]
    weight = around - around.min() + 1e-9
    index = np.indices(around.shape).reshape(3, -1)
    return np.asarray(index @ weight.ravel() / weight.sum() + low)
