"""Where a scan lies in the map after a silence: every turn and shift within reach is tried, on coarse cells.

Over a second of walking unheard the guess is off by half a metre and ten degrees: too far for the update to find.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pipeline.odometry import so3
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.state import State
from pipeline.odometry.vote_kernels import votes

CELL_M = 0.6
HALF_M, HALF_UP_M = 18.0, 6.0
"""Of the box about the sensor whose points are used: farther ones go astray by a cell with each step of yaw."""
LEAST_M, MOST_M, UP_M = 2.4, 9.0, 1.8
"""Bounds of the shift."""
STEP_RAD = math.radians(3.0)


def relocate(known_m: Doubles, seen_m: Doubles, guess: State, yaw_sigma: float, reach_m: float) -> State:
    """The guess, turned about the vertical by up to three sigmas and shifted, where the most of the scan meets the map.

    known_m: (k, 3) places in the map. seen_m: (n, 3) points of the scan, `base_link`. reach_m: of the shift.
    """
    occupied = np.zeros(2 * _cells_each_way(), np.bool_)
    occupied[tuple(_cells(known_m - guess.position_m).T)] = True
    across, up = math.ceil(min(max(reach_m, LEAST_M), MOST_M) / CELL_M), math.ceil(UP_M / CELL_M)
    turns = math.ceil(min(3.0 * yaw_sigma, math.pi) / STEP_RAD)
    best, found = -1, guess
    for yaw in STEP_RAD * np.arange(-turns, turns + 1):
        rotation = so3.exp(np.array([0.0, 0.0, yaw])) @ guess.rotation
        count = votes(occupied, _cells(seen_m @ rotation.T), across, up)
        i, j, k = np.unravel_index(int(count.argmax()), count.shape)
        if count[i, j, k] > best:
            best, shift = count[i, j, k], CELL_M * np.array([i - across, j - across, k - up], np.float64)
            found = replace(guess, rotation=rotation, position_m=guess.position_m + shift)
    return found


def _cells(points_m: Doubles) -> npt.NDArray[np.int32]:
    """The cells (m, 3) of the box that hold a point, each once; points (n, 3) from the middle of the box."""
    half = _cells_each_way()
    cells = np.floor(points_m / CELL_M).astype(np.int32) + half
    return np.unique(cells[((cells >= 0) & (cells < 2 * half)).all(axis=1)], axis=0)


def _cells_each_way() -> npt.NDArray[np.int32]:
    return np.array([HALF_M / CELL_M, HALF_M / CELL_M, HALF_UP_M / CELL_M], np.int32)
