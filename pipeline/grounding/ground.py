"""The ground around a place, as far as needed to tell a stem's base from its crown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from pipeline.grounding.ground_kernels import lowest

Array = npt.NDArray[np.float64]
CELL_M = 1.0
RANK = 2
"""The third lowest point of a cell: two may be stray."""
WINDOW = 5
STEEPEST_M = 0.9
"""A cell that stands higher than this above the lowest of its neighbourhood, opened, saw no ground."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """height_m: (nx, ny) at the middles of cells of `CELL_M` from `origin_m` (x, y)."""

    origin_m: Array
    height_m: Array

    @classmethod
    def under(cls, points_m: Array) -> Ground:
        """Of points (n, 3), n > 0."""
        origin = np.floor(points_m.min(axis=0)[:2] / CELL_M) * CELL_M
        rows, columns = (np.floor((points_m.max(axis=0)[:2] - origin) / CELL_M).astype(int) + 1).tolist()
        height = lowest(np.ascontiguousarray(points_m, np.float64), origin, CELL_M, rows, columns, RANK)
        return cls(origin, _opened(height))

    def at(self, xy_m: Array) -> Array:
        """(n,) height of the ground under (n, 2); beyond the grid, that of its rim."""
        where = (xy_m - self.origin_m) / CELL_M - 0.5
        return np.asarray(ndimage.map_coordinates(self.height_m, where.T, order=1, mode="nearest"))


def _opened(height: Array) -> Array:
    """Without what no ground was seen under, which takes the height of the nearest cell that has it."""
    filled = _filled(height, np.isnan(height))
    low = ndimage.grey_opening(filled, size=(WINDOW, WINDOW))
    return _filled(filled, np.isnan(height) | (filled > low + STEEPEST_M))


def _filled(height: Array, missing: npt.NDArray[np.bool_]) -> Array:
    if missing.all() or not missing.any():
        return np.nan_to_num(height)
    nearest = ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(height[tuple(nearest)])
