"""A map as far as an alignment needs it: ground, canopy, stems, and where it says anything about them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.alignment.cloud import Batch
from pipeline.alignment.grid import MOST_CELLS, Array, Grid, Mask
from pipeline.alignment.standing import CELL_M, Standing
from pipeline.alignment.surface import Surface, closed

Source = Callable[[], Iterable[Batch]]
"""Reads the map from its beginning, whenever it is called."""
BELOW_CROWNS_M = 5.0
LEAST_SEEN = 3
"""Points below the crowns in a cell of the footprint."""
CLOSED_M = 2.0
STEM_MARGIN_M = 3.0
"""Around the outermost stems of a table."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Rasters (nx, ny) on one grid. stems_m: (n, 2), weights: (n,) their say.

    covered: where ground and canopy are known. looked: where stems would have been found.
    """

    grid: Grid
    terrain_m: Array | None
    canopy_m: Array | None
    covered: Mask
    stems_m: Array | None
    weights: Array | None
    looked: Mask


def aerial_scene(source: Source, grid: Grid) -> Scene:
    """Of an aerial cloud, which shows no stems."""
    surface = Surface(grid)
    for batch in source():
        surface.add(batch)
    terrain = surface.terrain_m()
    known = surface.known
    return Scene(grid, terrain, surface.canopy_m(terrain), known, None, None, np.zeros_like(known))


def terrestrial_scene(source: Source, grid: Grid) -> Scene:
    """Of a ground map; read twice, for stems can be told only above the ground."""
    surface = Surface(grid)
    for batch in source():
        surface.add(batch)
    terrain = surface.terrain_m()
    fine = max(CELL_M, float(np.sqrt(np.prod(grid.shape) * grid.cell_m**2 / MOST_CELLS)))
    standing = Standing(Grid.over(grid.origin_m, grid.origin_m + grid.cell_m * np.array(grid.shape), fine))
    below = np.zeros(terrain.size, np.int64)
    for batch in source():
        cells, inside = grid.cells(batch.xyz_m[:, :2])
        height = batch.xyz_m[:, 2] - terrain.ravel()[cells]
        standing.add(batch.xyz_m[inside, :2], height[inside])
        low = inside & (height < BELOW_CROWNS_M)
        below += np.bincount(cells[low], minlength=below.size)
    looked = closed(below.reshape(grid.shape) >= LEAST_SEEN, CLOSED_M / grid.cell_m)
    stems = standing.stems_m()
    cells, inside = grid.cells(stems)
    stems = stems[inside & looked.ravel()[cells]]
    return Scene(grid, terrain, surface.canopy_m(terrain), surface.count > 0, stems, np.ones(len(stems)), looked)


def stem_scene(stems_m: Array, weights: Array, grid: Grid) -> Scene:
    """Of a table of stems, n > 0, which says nothing of ground and canopy."""
    cells, _ = grid.cells(stems_m[:, :2])
    at = np.zeros(grid.shape, np.bool_)
    at.reshape(-1)[cells] = True
    radius = max(_widest_gap(stems_m[:, :2]), STEM_MARGIN_M) / grid.cell_m
    looked = closed(at, radius, STEM_MARGIN_M / grid.cell_m)
    return Scene(grid, None, None, np.zeros_like(looked), stems_m, weights, looked)


def _widest_gap(stems_m: Array) -> float:
    """Half the distance that closes a stand: three times that of neighbours, mostly."""
    if len(stems_m) < 2:
        return STEM_MARGIN_M
    nearest = np.asarray(cKDTree(stems_m).query(stems_m, k=2)[0])[:, 1]
    return float(1.5 * np.percentile(nearest, 90) + STEM_MARGIN_M)
