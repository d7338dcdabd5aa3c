"""A map as PLY."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline import ply
from pipeline.inventory.errors import InventoryError
from pipeline.inventory.source import AT_ONCE, Part, check_extent


class PlyMap:
    """The vertices of a PLY file that begins with them, as every scanner's does."""

    crs = None
    voxel_m = 0.0

    def __init__(self, path: Path) -> None:
        self._path = path
        self.count, low, high = 0, np.full(3, np.inf), np.full(3, -np.inf)
        for xyz in self._points():
            self.count += len(xyz)
            low, high = np.minimum(low, xyz.min(axis=0)), np.maximum(high, xyz.max(axis=0))
        if self.count == 0:
            raise InventoryError(f"{path}: has no points")
        check_extent(path, low, high)
        self.origin_m = np.floor(low)
        self.bounds_m = np.array([low, high])[:, :2] - self.origin_m[:2]

    @property
    def name(self) -> str:
        """Of the file."""
        return self._path.name

    def placed(self, xyz_m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """In the coordinates of the file."""
        return np.asarray(xyz_m + self.origin_m)

    def parts(self) -> Iterator[Part]:
        """All points, in the order of the file. InventoryError where it breaks off."""
        for xyz in self._points():
            yield Part((xyz - self.origin_m).astype(np.float32), np.zeros(len(xyz), np.bool_))

    def _points(self) -> Iterator[npt.NDArray[np.float64]]:
        try:
            yield from ply.batches(self._path, AT_ONCE)
        except ply.PlyError as error:
            raise InventoryError(f"{error}; copy it, or export it again") from error
