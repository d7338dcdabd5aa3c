"""The stems of a submap: what a place among trees is recognised by, whoever comes by and from whichever side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pipeline.alignment.cloud import Batch
from pipeline.alignment.grid import Grid
from pipeline.alignment.scene import terrestrial_scene
from pipeline.estimates import Array

CELL_M = 0.5
"""Of the ground, above which stems are looked for, and of where they would have been seen."""
NEIGHBOURS = 6
"""Of a stem, which any two make a triangle with."""
SHORTEST_M, LONGEST_M = 1.0, 15.0


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """stems_m: (n, 3) axes at the ground, in `odom`. looked: (nx, ny) where stems would have been seen, on `grid`."""

    stems_m: Array
    looked: npt.NDArray[np.bool_]
    grid: Grid

    def seen(self, xy_m: Array) -> npt.NDArray[np.bool_]:
        """(n,) whether a stem there (n, 2) would have been seen."""
        cells, inside = self.grid.cells(xy_m)
        return np.asarray(self.looked.ravel()[cells] & inside)


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """sides_m: (t, 3), ascending. corners: (t, 3) rows of the stems, each across from the side of its column. left:
    (t,) whether they turn counter-clockwise."""

    sides_m: Array
    corners: npt.NDArray[np.int64]
    left: npt.NDArray[np.bool_]


def place(points: npt.NDArray[np.float32]) -> Place:
    """Of a submap's points (n, 3), level."""
    xyz = points.astype(np.float64)
    grid = Grid.over(xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0) + CELL_M, CELL_M)
    nothing = np.zeros(len(xyz))
    batch = Batch(xyz, nothing.astype(np.uint8), nothing.astype(np.uint16), nothing)
    scene = terrestrial_scene(lambda: (batch,), grid)
    assert scene.stems_m is not None
    assert scene.terrain_m is not None
    cells, _ = grid.cells(scene.stems_m)
    return Place(np.column_stack([scene.stems_m, scene.terrain_m.ravel()[cells]]), scene.looked, grid)


def triangles(stems_m: Array) -> Triangles:
    """Of each stem (n, 2 or more) with two of its nearest ones, each once."""
    xy = stems_m[:, :2]
    if len(xy) <= NEIGHBOURS:
        return _described(xy, np.empty((0, 3), np.int64))
    near = np.asarray(cKDTree(xy).query(xy, k=NEIGHBOURS + 1)[1])
    first, second = np.triu_indices(NEIGHBOURS, 1)
    rows = np.stack([np.repeat(near[:, :1], len(first), 1), near[:, 1 + first], near[:, 1 + second]], axis=-1)
    return _described(xy, np.unique(np.sort(rows.reshape(-1, 3), axis=1), axis=0))


def _described(xy: Array, rows: npt.NDArray[np.int64]) -> Triangles:
    corners = xy[rows]
    sides = np.linalg.norm(corners[:, [1, 2, 0]] - corners[:, [2, 0, 1]], axis=2)
    order = np.argsort(sides, axis=1)
    sides, rows = np.take_along_axis(sides, order, 1), np.take_along_axis(rows, order, 1)
    fit = (sides[:, 0] > SHORTEST_M) & (sides[:, 2] < LONGEST_M)
    sides, rows = sides[fit], rows[fit]
    one, two = (xy[rows[:, k]] - xy[rows[:, 0]] for k in (1, 2))
    return Triangles(sides, rows, one[:, 0] * two[:, 1] > one[:, 1] * two[:, 0])
