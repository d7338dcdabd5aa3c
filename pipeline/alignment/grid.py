"""Square cells over a place, axis 0 along x and axis 1 along y."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
MOST_CELLS = 40_000_000
"""Of one raster: 320 MB as doubles."""


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """origin_m: (2,) outer corner of the first cell. shape: cells along x and y."""

    origin_m: Array
    cell_m: float
    shape: tuple[int, int]

    @classmethod
    def over(cls, low_m: Array, high_m: Array, cell_m: float) -> Grid:
        """From corner to corner (2,), the origin on a multiple of the cell."""
        origin = np.floor(np.asarray(low_m) / cell_m) * cell_m
        wide, high = np.maximum(np.ceil((np.asarray(high_m) - origin) / cell_m).astype(np.int64), 1).tolist()
        return cls(origin, cell_m, (wide, high))

    @property
    def middle_m(self) -> Array:
        """(2,)"""
        return np.asarray(self.origin_m + 0.5 * self.cell_m * np.array(self.shape))

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """west, east, south, north"""
        east, north = (self.origin_m + self.cell_m * np.array(self.shape)).tolist()
        return float(self.origin_m[0]), east, float(self.origin_m[1]), north

    def centres_m(self) -> Array:
        """(nx, ny, 2)"""
        x, y = (self.origin_m[k] + self.cell_m * (np.arange(self.shape[k]) + 0.5) for k in (0, 1))
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)

    def cells(self, xy_m: Array) -> tuple[npt.NDArray[np.int64], Mask]:
        """Flat index (n,) of points (n, 2), and which of them lie inside; the others have index 0."""
        index = np.floor((xy_m - self.origin_m) / self.cell_m).astype(np.int64)
        inside = np.all((index >= 0) & (index < self.shape), axis=1)
        index[~inside] = 0
        return index[:, 0] * self.shape[1] + index[:, 1], inside

    def fractional(self, xy_m: Array) -> Array:
        """(..., 2) in cells from the middle of the first one."""
        return np.asarray((xy_m - self.origin_m) / self.cell_m - 0.5)
