"""Where the points around the camera come from: the tiles of a session, or the last sweeps of a live one."""

from __future__ import annotations

from collections import OrderedDict, deque
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.products.tiles import Tile, read_tile, tiles

Array = npt.NDArray[np.float64]
TILES_HELD = 24
"""Of 16 m: what is within 22 m of the camera, and what was there lately."""


class TilePoints:
    """A finished map. voxel_m: one point in each is enough here."""

    def __init__(self, folder: Path, tile_m: float, voxel_m: float) -> None:
        self._folder = folder
        self._tile_m = tile_m
        self._voxel_m = voxel_m
        self._there = set(tiles(folder))
        self._held: OrderedDict[Tile, Array] = OrderedDict()

    def around(self, place_m: Array, radius_m: float) -> Array:
        """(n, 3) points within a radius of a place (3,)."""
        low, high = (np.floor((place_m[:2] + side * radius_m) / self._tile_m).astype(int).tolist() for side in (-1, 1))
        wanted = [(i, j) for i in range(low[0], high[0] + 1) for j in range(low[1], high[1] + 1)]
        parts = [_within(self._tile(tile), place_m, radius_m) for tile in wanted if tile in self._there]
        return np.concatenate(parts) if parts else np.empty((0, 3))

    def _tile(self, tile: Tile) -> Array:
        if tile not in self._held:
            self._held[tile] = read_tile(self._folder, tile, self._voxel_m)["xyz"].astype(np.float64)
            while len(self._held) > TILES_HELD:
                self._held.popitem(last=False)
        self._held.move_to_end(tile)
        return self._held[tile]


class RollingPoints:
    """The points of the last sweeps, `a_sweep` of each at most. Not thread-safe."""

    def __init__(self, sweeps: int = 400, a_sweep: int = 2500) -> None:
        self._sweeps: deque[npt.NDArray[np.float32]] = deque(maxlen=sweeps)
        self._a_sweep = a_sweep

    def add(self, points_m: npt.NDArray[np.float32]) -> None:
        """A sweep's (n, 3), in the frame of the odometry."""
        stride = max(1, -(-len(points_m) // self._a_sweep))
        self._sweeps.append(points_m[::stride].copy())

    def around(self, place_m: Array, radius_m: float) -> Array:
        """(n, 3) points within a radius of a place (3,)."""
        if not self._sweeps:
            return np.empty((0, 3))
        return _within(np.concatenate(self._sweeps).astype(np.float64), place_m, radius_m)


def _within(points_m: Array, place_m: Array, radius_m: float) -> Array:
    away = points_m - place_m
    return np.asarray(points_m[np.einsum("ni,ni->n", away, away) < radius_m**2])
