"""A session's map while it is between the stages: every point knows its sweep, and so where the scanner was."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyproj

from pipeline.inventory.errors import InventoryError
from pipeline.inventory.source import Part
from pipeline.products.earth import Site
from pipeline.products.tiles import RETRO, read_tile, tiles
from pipeline.products.track import Placement

Doubles = npt.NDArray[np.float64]


class TileMap:
    """In the frame of the placement, else in `odom`. positions_m: (k, 3) of each sweep in `odom`."""

    def __init__(
        self, folder: Path, voxel_m: float, positions_m: Doubles, placement: Placement | None, name: str = ""
    ) -> None:
        self._folder, self.voxel_m, self._placement = folder, voxel_m, placement
        self.name = name or folder.name
        datum = None if placement is None else placement.datum
        self._site = Site(datum) if datum is not None else None
        self.crs: pyproj.CRS | None = self._site.crs if self._site is not None else None
        ordinals = np.arange(len(positions_m))
        self._sensor = positions_m if placement is None else placement.points(positions_m, ordinals)
        self.origin_m = np.zeros(3)
        low, high, self.count = np.full(2, np.inf), np.full(2, -np.inf), 0
        for part in self.parts():
            self.count += len(part.xyz_m)
            low, high = np.minimum(low, part.xyz_m[:, :2].min(axis=0)), np.maximum(high, part.xyz_m[:, :2].max(axis=0))
        if not self.count:
            raise InventoryError(f"{folder}: the session's map has no points; process the recording again")
        self.bounds_m = np.array([low, high])

    def placed(self, xyz_m: Doubles) -> Doubles:
        """(n, 3) in the frame of the map -> in the site's UTM zone, or as they are."""
        return xyz_m if self._site is None else self._site.utm(xyz_m)

    def parts(self) -> Iterator[Part]:
        """Tile by tile."""
        for tile in tiles(self._folder):
            points = read_tile(self._folder, tile, self.voxel_m)
            if not len(points):
                continue
            sweeps = points["sweep"].astype(np.int64)
            xyz = points["xyz"].astype(np.float64)
            if self._placement is not None:
                xyz = self._placement.points(xyz, sweeps)
            sensor = self._sensor[sweeps, :2].astype(np.float32)
            yield Part(xyz.astype(np.float32), points["intensity"] >= RETRO, sensor)
