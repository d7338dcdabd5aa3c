"""The ground below a map: lowest points, opened by growing windows, filled and smoothed; the height of points above it.

A progressive morphological filter (Zhang et al. 2003) that works on what is left when the trend is taken off: on a
slope, an opening cuts into the hillside at every border otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from pipeline.inventory import terrain_kernels as kernels
from pipeline.inventory.config import InventoryConfig
from pipeline.inventory.errors import InventoryError
from pipeline.inventory.source import MapSource, Part

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
RANKS = 3
"""So many of the lowest points of a cell are kept: of a well-seen cell the third counts, for two may be stray."""
RADII_M = (0.5, 1.0, 2.0, 4.0)
STANDS_OUT_M, BUMP = 0.15, 0.25
"""A cell is no ground that lies higher above its neighbourhood, opened, than this and this a metre of window."""
TREND_M = 4.0
NEAR_M = (-0.15, 0.12)
"""Points this near to a first ground tell the last one."""
LEAST_NEAR = 5
MOST_CELLS = 30_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """ground_m: (nx, ny) heights at the middles of cells from low_m (x, y). seen: (nx, ny) whether points told it."""

    low_m: Doubles
    cell_m: float
    ground_m: Doubles
    seen: npt.NDArray[np.bool_]

    def above(self, xyz_m: Floats) -> Floats:
        """(n,) heights of points (n, 3) above the ground."""
        return np.asarray(kernels.heights(xyz_m, self.ground_m, self.low_m, self.cell_m))

    def at(self, xy_m: Doubles) -> Doubles:
        """(n,) ground below (n, 2); beyond the grid, that of its rim."""
        where = (xy_m - self.low_m) / self.cell_m - 0.5
        return np.asarray(ndimage.map_coordinates(self.ground_m, where.T, order=1, mode="nearest"))


class TerrainBuilder:
    """Takes all points once, then once more to smooth. InventoryError for an extent beyond reason."""

    def __init__(self, source: MapSource, config: InventoryConfig) -> None:
        self._cell_m, self._steepest = config.terrain_cell_m, config.steepest
        self._low = source.bounds_m[0] - self._cell_m
        shape = np.ceil((source.bounds_m[1] - self._low) / self._cell_m).astype(int) + 1
        if shape.prod() > MOST_CELLS:
            wide, high = source.bounds_m[1] - source.bounds_m[0]
            raise InventoryError(
                f"{source.name}: {wide:,.0f} by {high:,.0f} m are too much for one ground model; are there stray "
                "points far away? Cut the map, or raise inventory.terrain_cell_m"
            )
        self._lowest = np.full((*shape, RANKS), np.inf, np.float32)
        self._count = np.zeros(shape, np.int64)

    def add(self, part: Part) -> None:
        """First time."""
        kernels.keep_lowest(self._lowest, self._count, part.xyz_m, self._low, self._cell_m)

    def most_within(self, side_m: float) -> int:
        """Points of the fullest square of that side."""
        cells = max(1, round(side_m / self._cell_m))
        count: Doubles = self._count.astype(np.float64)
        for axis in (0, 1):
            count = ndimage.uniform_filter1d(count, cells, axis, mode="constant") * cells
        return round(float(count.max()))

    def first(self) -> Terrain:
        """From the lowest points. InventoryError without any."""
        if not self._count.any():
            raise InventoryError("the map has no points within its own bounds; its header is damaged")
        rank = np.minimum(self._count // 10, RANKS - 1)
        lowest = np.take_along_axis(self._lowest, rank[..., None], axis=2)[..., 0].astype(np.float64)
        lowest[self._count == 0] = np.nan
        ground, seen = opened(lowest, self._cell_m, self._steepest)
        return Terrain(self._low, self._cell_m, ground, seen)


class TerrainPolish:
    """Moves a first ground to the mean of the points that lie on it: the lowest ones lie below by their noise."""

    def __init__(self, first: Terrain) -> None:
        self._first = first
        self._total = np.zeros(first.ground_m.shape)
        self._count = np.zeros(first.ground_m.shape, np.int64)

    def add(self, part: Part, height_m: Floats) -> None:
        """Second time, with their heights above the first ground."""
        kernels.add_near(
            self._total, self._count, part.xyz_m, height_m, low=self._first.low_m, cell_m=self._first.cell_m,
            below_m=NEAR_M[0], above_m=NEAR_M[1],
        )  # fmt: skip

    def done(self) -> Terrain:
        """The ground."""
        first = self._first
        known = (self._count >= LEAST_NEAR) & first.seen
        shift = np.where(known, self._total / np.maximum(self._count, 1), np.nan)
        return Terrain(first.low_m, first.cell_m, first.ground_m + filled(shift, first.cell_m), first.seen)


def opened(lowest: Doubles, cell_m: float, steepest: float) -> tuple[Doubles, npt.NDArray[np.bool_]]:
    """Ground (nx, ny) of lowest heights with NaN where there are none, and which cells it stands on."""
    kept = np.isfinite(lowest)
    trend = _coarse(np.where(kept, lowest, np.nan), cell_m, steepest)
    for radius_m in (*RADII_M, *RADII_M):  # the second time over a trend without what stood out at first
        ground = filled(np.where(kept, lowest - trend, np.nan), cell_m)
        reach = max(1, round(radius_m / cell_m))
        disk = np.hypot(*np.mgrid[-reach : reach + 1, -reach : reach + 1]) <= reach + 0.5
        low = ndimage.grey_opening(ground, footprint=disk)
        kept &= ground <= low + STANDS_OUT_M + BUMP * radius_m
        if radius_m == RADII_M[-1]:
            trend = trend + _smooth(filled(np.where(kept, lowest - trend, np.nan), cell_m), TREND_M / cell_m)
    return trend + filled(np.where(kept, lowest - trend, np.nan), cell_m), kept


def _coarse(lowest: Doubles, cell_m: float, steepest: float) -> Doubles:
    """A first trend: what is steeper than ground can be, seen from what is lower around it, is left out."""
    bottom = np.where(np.isfinite(lowest), lowest, np.inf)
    kept = np.isfinite(lowest)
    for radius_m in (2.0, 6.0):
        size = 2 * max(1, round(radius_m / cell_m)) + 1
        kept &= bottom <= ndimage.minimum_filter(bottom, size) + 0.3 + steepest * radius_m
    return _smooth(filled(np.where(kept, lowest, np.nan), cell_m), TREND_M / cell_m)


def filled(values: Doubles, cell_m: float) -> Doubles:
    """NaN replaced by what is around, from near to far (normalised convolution)."""
    known = np.isfinite(values)
    if known.all():
        return values
    if not known.any():
        return np.zeros_like(values)
    weighed, out = np.where(known, values, 0.0), values.copy()
    for reach_m in (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 64.0):
        missing = np.isnan(out)
        if not missing.any():
            return out
        sigma = reach_m / cell_m
        weight = ndimage.gaussian_filter(known.astype(np.float64), sigma)
        found = missing & (weight > 0.05)
        out[found] = (ndimage.gaussian_filter(weighed, sigma)[found]) / weight[found]
    nearest = ndimage.distance_transform_edt(np.isnan(out), return_distances=False, return_indices=True)
    return np.asarray(out[tuple(nearest)])


def _smooth(values: Doubles, sigma: float) -> Doubles:
    return np.asarray(ndimage.gaussian_filter(values, sigma, mode="nearest"))
