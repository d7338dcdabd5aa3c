"""Stems in the map: where points stand above each other. Boxes are put on them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import ndimage

Array = npt.NDArray[np.float64]
LOWEST_M, HIGHEST_M, LAYER_M = 0.5, 3.0, 0.25
CELL_M = 0.1
LAYERS = round((HIGHEST_M - LOWEST_M) / LAYER_M)
STANDING = 0.6
"""Share of the layers that a stem fills."""
WIDEST_M = 0.9
SIGMA_M = 0.12
"""Of the axis found: its near side is what was seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Stem:
    """place_m: (2,) of the axis. layers: share of the heights at which it was seen."""

    place_m: Array
    layers: float


def find_stems(points_m: Array, height_m: Array) -> list[Stem]:
    """Among points (n, 3) with their heights above the ground (n,)."""
    low = (height_m > LOWEST_M) & (height_m < HIGHEST_M)
    points, height = points_m[low], height_m[low]
    if not len(points):
        return []
    origin = points[:, :2].min(axis=0) - CELL_M
    cells = ((points[:, :2] - origin) / CELL_M).astype(np.int64)
    layer = np.minimum(((height - LOWEST_M) / LAYER_M).astype(np.int64), LAYERS - 1)
    filled = np.zeros((LAYERS, *(cells.max(axis=0) + 2)), np.bool_)
    filled[layer, cells[:, 0], cells[:, 1]] = True
    # A stem leans and is rough: what stands in the next cell counts.
    share = ndimage.maximum_filter(filled.view(np.uint8), size=(1, 3, 3)).mean(axis=0)
    labels, count = ndimage.label(share >= STANDING, np.ones((3, 3)))
    label = labels[cells[:, 0], cells[:, 1]]
    order = np.argsort(label, kind="stable")
    bounds = np.searchsorted(label[order], np.arange(1, count + 2))
    found = []
    for first, last in pairwise(bounds.tolist()):
        mine = points[order[first:last], :2]
        if len(mine) >= LAYERS and np.ptp(mine, axis=0).max() < WIDEST_M:
            at = cells[order[first:last]]
            found.append(Stem(np.median(mine, axis=0), float(share[at[:, 0], at[:, 1]].max())))
    return found
