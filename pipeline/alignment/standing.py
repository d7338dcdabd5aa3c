"""Stems of a ground map: where points stand above each other, gathered batch by batch.

Enough to place stems for an alignment; diameters and doubtful stems are the inventory's.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from pipeline.alignment.grid import Array, Grid

CELL_M = 0.1
LOWEST_M, LAYER_M = 1.0, 0.25
LAYERS = 16
"""Up to 5 m: one bit each."""
STANDING = 0.55
"""Share of the layers, from the lowest to the highest seen nearby, that a stem fills."""
LEAST_LAYERS = 6
WIDEST_M = 1.2
_BITS = np.array([bin(value).count("1") for value in range(1 << LAYERS)], np.uint8)


@dataclass(slots=True, eq=False)
class Standing:
    """filled: (nx, ny) a bit for each layer that holds a point."""

    grid: Grid
    filled: npt.NDArray[np.uint16] = field(init=False)

    def __post_init__(self) -> None:
        self.filled = np.zeros(self.grid.shape, np.uint16)

    def add(self, xy_m: Array, height_m: Array) -> None:
        """Places (n, 2) and heights above the ground (n,)."""
        layer = np.floor((height_m - LOWEST_M) / LAYER_M).astype(np.int64)
        cells, inside = self.grid.cells(xy_m)
        inside &= (layer >= 0) & (layer < LAYERS)
        bits = np.left_shift(1, layer[inside]).astype(np.uint16)
        np.bitwise_or.at(self.filled.reshape(-1), cells[inside], bits)

    def stems_m(self) -> Array:
        """(n, 2) axes at the heights seen."""
        tall = _layers(_spread(self.filled)) >= max(LEAST_LAYERS, round(STANDING * LAYERS))
        labels, count = ndimage.label(tall, np.ones((3, 3)))
        if not count:
            return np.empty((0, 2))
        weight = _layers(self.filled).astype(np.float64) + 1e-3
        middles = np.array(ndimage.center_of_mass(weight, labels, np.arange(1, count + 1)))
        narrow = [
            max(s.stop - s.start for s in box) * self.grid.cell_m <= WIDEST_M for box in ndimage.find_objects(labels)
        ]
        return np.asarray(self.grid.origin_m + (middles[narrow] + 0.5) * self.grid.cell_m)


def _spread(filled: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint16]:
    """With the layers of the eight cells around: stems lean and are rough."""
    padded = np.pad(filled, 1)
    found = np.zeros_like(filled)
    for dx in range(3):
        for dy in range(3):
            found |= padded[dx : dx + filled.shape[0], dy : dy + filled.shape[1]]
    return found


def _layers(filled: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint8]:
    """How many bits are set."""
    return np.asarray(_BITS[filled])
