"""What stands highest above each place, and which tree it belongs to: heights and crowns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from pipeline.inventory import terrain_kernels as kernels
from pipeline.inventory.stem import Stem
from pipeline.inventory.terrain import Terrain

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
LEAST_M, CROWN_SHARE = 2.0, 0.25
"""A crown stands at least this high, and this share of its tree's height."""
WIDEST_M = 8.0
"""From the stem to the rim."""
SMOOTH_M = 0.5
TOP_M = 2.0
"""A tree's top is looked for this far around the axis, within its crown."""


@dataclass(frozen=True, slots=True, eq=False)
class Canopy:
    """height_m: (nx, ny) above the ground, NaN where nothing was seen; owner: (nx, ny) ordinal of the tree, -1 none."""

    low_m: Doubles
    cell_m: float
    height_m: Doubles
    owner: npt.NDArray[np.int32]

    def owners(self, xy_m: npt.NDArray[np.floating]) -> npt.NDArray[np.int32]:
        """(n,) ordinals of trees whose crown is above or below points (n, 2)."""
        with np.errstate(invalid="ignore"):
            cells = np.nan_to_num((xy_m - self.low_m) / self.cell_m, nan=-1.0).astype(np.int64)
        inside = ((cells >= 0) & (cells < self.owner.shape)).all(axis=1)
        cells[~inside] = 0
        return np.where(inside, self.owner[cells[:, 0], cells[:, 1]], -1).astype(np.int32)

    def sizes(self, stems: list[Stem]) -> tuple[Doubles, Doubles]:
        """Height and crown diameter (n,) of each stem's tree, NaN where no crown was seen."""
        heights, crowns = np.full(len(stems), np.nan), np.full(len(stems), np.nan)
        slots: list[Any] = ndimage.find_objects(self.owner + 1, max_label=len(stems))
        for number, (stem, slot) in enumerate(zip(stems, slots, strict=True)):
            if slot is None:
                continue
            mine = self.owner[slot] == number
            above = np.where(mine, self.height_m[slot], np.nan)
            crowns[number] = 2.0 * np.sqrt(mine.sum() * self.cell_m**2 / np.pi)
            x, y = np.meshgrid(*(np.arange(s.start, s.stop) + 0.5 for s in slot), indexing="ij")
            place = np.stack([x, y], axis=-1) * self.cell_m + self.low_m
            tall = float(np.nanmax(above))
            near = np.hypot(*np.moveaxis(place - stem.axis_at(tall), -1, 0)) < TOP_M
            near &= np.isfinite(above)
            heights[number] = float(np.nanmax(above[near])) if near.any() else tall
        return heights, crowns


class CanopyBuilder:
    """Takes parts with their heights above the ground."""

    def __init__(self, terrain: Terrain, cell_m: float) -> None:
        self._low, self._cell_m = terrain.low_m, cell_m
        shape = np.ceil(np.array(terrain.ground_m.shape) * terrain.cell_m / cell_m).astype(int) + 1
        # The second highest: the highest of a cell may be a stray.
        self._highest = np.full((*shape, 2), -np.inf, np.float32)

    def add(self, xyz_m: Floats, height_m: Floats) -> None:
        """Points (n, 3)."""
        above = np.column_stack([xyz_m[:, :2], height_m]).astype(np.float32)
        kernels.keep_highest(self._highest, above, self._low, self._cell_m)

    def done(self, stems: list[Stem]) -> Canopy:
        """Crowns grow downhill from the tops above the stems (watershed), as far as a crown reaches."""
        height = self._highest[..., 1].astype(np.float64)
        height[~np.isfinite(height)] = np.nan
        owner = np.full(height.shape, -1, np.int32)
        if stems:
            owner = self._owners(height, stems)
        return Canopy(self._low, self._cell_m, height, owner)

    def _owners(self, height: Doubles, stems: list[Stem]) -> npt.NDArray[np.int32]:
        smooth = ndimage.gaussian_filter(np.nan_to_num(height), SMOOTH_M / self._cell_m)
        tops = np.array([stem.axis_at(12.0 * min(1.0, stem.dbh_m / 0.15)) for stem in stems])
        cells = np.clip(((tops - self._low) / self._cell_m).astype(int), 0, np.array(height.shape) - 1)
        markers = np.zeros(height.shape, np.int32)
        for number in reversed(range(len(stems))):
            markers[cells[number, 0], cells[number, 1]] = number + 1
        relief = np.round(np.clip(smooth.max() - smooth, 0.0, 650.0) * 100.0).astype(np.uint16)
        owner = ndimage.watershed_ift(relief, markers) - 1
        x, y = np.meshgrid(*(np.arange(n) + 0.5 for n in height.shape), indexing="ij")
        place = np.stack([x, y], axis=-1) * self._cell_m + self._low
        away = np.hypot(*np.moveaxis(place - tops[owner], -1, 0))
        tallest = ndimage.maximum(np.nan_to_num(height), owner, np.arange(len(stems)))
        low = np.nan_to_num(height) < np.maximum(LEAST_M, CROWN_SHARE * np.asarray(tallest)[owner])
        return np.where((away > WIDEST_M) | low, -1, owner).astype(np.int32)
