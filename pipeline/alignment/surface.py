"""Top and ground of a cloud as rasters, gathered batch by batch."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from pipeline.alignment.cloud import GROUND, Batch
from pipeline.alignment.grid import Array, Grid, Mask

WINDOWS_M = (1.5, 3.5, 6.5, 10.5)
STEEPEST = 0.6
"""Slope that the opening allows for: what rises faster over a window stands on the ground."""
ROUGH_M = 0.3
STRAY_M = 1.0
"""A lowest point this far below its neighbours' lowest points is an echo."""
GAP_M = 4.0
"""Wider gaps between points say nothing."""
PIT_M = 2.0
"""Where a beam fell through a crown."""
SMOOTH_M = 0.5


@dataclass(slots=True, eq=False)
class Surface:
    """highest, lowest, ground: (nx, ny), infinite where no point fell; ground: of points classified so."""

    grid: Grid
    highest: Array = field(init=False)
    lowest: Array = field(init=False)
    ground: Array = field(init=False)
    count: npt.NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self.highest = np.full(self.grid.shape, -np.inf)
        self.lowest = np.full(self.grid.shape, np.inf)
        self.ground = np.full(self.grid.shape, np.inf)
        self.count = np.zeros(self.grid.shape, np.int64)

    def add(self, batch: Batch) -> None:
        """Points off the grid are left out."""
        cells, inside = self.grid.cells(batch.xyz_m[:, :2])
        cells, z = cells[inside], batch.xyz_m[inside, 2]
        np.maximum.at(self.highest.reshape(-1), cells, z)
        np.minimum.at(self.lowest.reshape(-1), cells, z)
        classified = batch.kind[inside] == GROUND
        np.minimum.at(self.ground.reshape(-1), cells[classified], z[classified])
        self.count += np.bincount(cells, minlength=self.count.size).reshape(self.count.shape)

    @property
    def known(self) -> Mask:
        """Where points fell, and the gaps between them; not beyond their rim."""
        return closed(self.count > 0, GAP_M / 2 / self.grid.cell_m)

    def terrain_m(self) -> Array:
        """(nx, ny) height of the ground, everywhere; from classified points where there are enough."""
        cell = self.grid.cell_m
        classified = np.isfinite(self.ground)
        if classified.sum() > 0.02 * np.isfinite(self.lowest).sum():
            return smoothed(self.ground, classified, SMOOTH_M / cell)
        return opened(self.lowest, cell)

    def canopy_m(self, terrain_m: Array) -> Array:
        """(nx, ny) height of the highest point above the ground, pits filled, 0 where nothing is known."""
        seen = self.count > 0
        height = np.where(seen, self.highest - terrain_m, 0.0)
        height = np.where(self.known, np.maximum(filled(height, ~seen), 0.0), 0.0)
        level = ndimage.median_filter(height, size=3)
        return np.asarray(np.where(level - height > PIT_M, level, height))


def opened(lowest: Array, cell_m: float) -> Array:
    """Ground from the lowest points (nx, ny): openings over growing windows take away what stands on it."""
    seen = np.isfinite(lowest)
    low = filled(np.where(seen, lowest, 0.0), ~seen)
    seen &= low > ndimage.median_filter(low, size=5) - STRAY_M
    low = filled(low, ~seen)
    for window_m in WINDOWS_M:
        size = 2 * round(window_m / cell_m / 2) + 1
        bottom = ndimage.grey_opening(low, size=(size, size))
        seen &= low <= bottom + ROUGH_M + STEEPEST * window_m / 2
        low = filled(low, ~seen)
    return smoothed(low, seen, SMOOTH_M / cell_m)


def smoothed(height: Array, seen: Mask, sigma: float) -> Array:
    """Averaged over what was seen nearby; beyond, by the nearest."""
    if not seen.any():
        return np.zeros_like(height)
    base = float(np.median(height[seen]))
    weight = ndimage.gaussian_filter(seen.astype(np.float64), sigma, truncate=6.0)
    total = ndimage.gaussian_filter(np.where(seen, height - base, 0.0), sigma, truncate=6.0)
    enough = weight > 1e-3
    return filled(np.where(enough, total / np.where(enough, weight, 1.0) + base, 0.0), ~enough)


def filled(height: Array, missing: Mask) -> Array:
    """Each missing cell takes the height of the nearest that is there."""
    if missing.all() or not missing.any():
        return height
    nearest = ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(height[tuple(nearest)])


def closed(mask: Mask, radius: float, grown: float = 0.0) -> Mask:
    """Gaps up to 2 radius closed, the rim grown by `grown`; all in cells."""
    if not mask.any():
        return mask
    room = int(np.ceil(radius + grown)) + 1
    padded = np.pad(mask, room)
    near = ndimage.distance_transform_edt(~padded) <= radius + grown
    kept = ndimage.distance_transform_edt(np.pad(near, 1))[1:-1, 1:-1] > radius
    return np.asarray(kept[room:-room, room:-room] | mask)
