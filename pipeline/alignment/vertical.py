"""How far one ground lies above another, once they lie over each other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pipeline.alignment.grid import Array
from pipeline.alignment.scene import Scene
from pipeline.alignment.transform import Transform

LEAST_CELLS = 100
CORRELATED_M2 = 30.0
"""Ground models err together over about 3 m."""
SIGMA_M = 0.05
"""Of the best of them: litter and grass."""


@dataclass(frozen=True, slots=True)
class Vertical:
    """shift_m: up, of the moved map. tilt_deg: between the two grounds, which are both taken to be level."""

    shift_m: float
    sigma_m: float
    tilt_deg: float


def ground_to_ground(fixed: Scene, moved: Scene, flat: Transform) -> Vertical | None:
    """The median difference; None where one of them has no ground, or they share too little of it."""
    if fixed.terrain_m is None or moved.terrain_m is None:
        return None
    places = moved.grid.centres_m()[moved.looked]
    at = fixed.grid.fractional(flat.apply(places)).T
    known = ndimage.map_coordinates(fixed.covered.astype(np.float64), at, order=1, mode="constant") > 0.99
    if known.sum() < LEAST_CELLS:
        return None
    there = ndimage.map_coordinates(fixed.terrain_m, at[:, known], order=1, mode="nearest")
    off = there - moved.terrain_m[moved.looked][known]
    shift = float(np.median(off))
    scatter = 1.4826 * float(np.median(np.abs(off - shift)))
    count = max(known.sum() * fixed.grid.cell_m**2 / CORRELATED_M2, 1.0)
    return Vertical(shift, math.hypot(scatter / math.sqrt(count), SIGMA_M), _tilt_deg(places[known], off, scatter))


def _tilt_deg(places_m: Array, off_m: Array, scatter_m: float) -> float:
    near = np.abs(off_m - np.median(off_m)) <= 3.0 * scatter_m + 0.05
    columns = np.column_stack([places_m[near] - places_m[near].mean(axis=0), np.ones(near.sum())])
    slope = np.linalg.lstsq(columns, off_m[near], rcond=None)[0][:2]
    return math.degrees(math.atan(float(np.hypot(*slope))))
