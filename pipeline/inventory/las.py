"""A map as LAS or LAZ."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import numpy.typing as npt
import pyproj

from pipeline.inventory.errors import InventoryError
from pipeline.inventory.source import AT_ONCE, Doubles, Part, check_extent

REFLECTOR = 150 * 257
"""Intensity of a Mid-360's retro-reflector as our maps have it, on the scale of LAS."""


class LasMap:
    """A LAS or LAZ file. Points that are marked as withheld or noise are left out."""

    voxel_m = 0.0

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            with laspy.open(path) as reader:
                header = reader.header
        except (laspy.LaspyException, OSError, ValueError, RuntimeError) as error:
            raise InventoryError(f"{path}: cannot be read as LAS or LAZ ({error}); copy it again") from error
        self.count = int(header.point_count)
        if not self.count:
            raise InventoryError(f"{path}: has no points")
        self.crs = _crs(path, header)
        low, high = np.array(header.mins), np.array(header.maxs)
        check_extent(path, low, high)
        self.origin_m = np.floor(low)
        self.bounds_m = np.array([low, high])[:, :2] - self.origin_m[:2]
        self._ours = header.generating_software.strip() == "mapforest"

    @property
    def name(self) -> str:
        """Of the file."""
        return self._path.name

    def placed(self, xyz_m: Doubles) -> Doubles:
        """In the coordinates of the file."""
        return np.asarray(xyz_m + self.origin_m)

    def parts(self) -> Iterator[Part]:
        """All points, in the order of the file. InventoryError where it breaks off."""
        try:
            with laspy.open(self._path) as reader:
                for record in reader.chunk_iterator(AT_ONCE):
                    yield self._part(record)
        except (laspy.LaspyException, OSError, ValueError, RuntimeError) as error:
            raise InventoryError(f"{self._path}: breaks off ({error}); copy it again") from error

    def _part(self, record: Any) -> Part:
        xyz = (np.column_stack([record.x, record.y, record.z]) - self.origin_m).astype(np.float32)
        xyz[_useless(record)] = np.nan
        bright = np.asarray(record.intensity) >= REFLECTOR if self._ours else np.zeros(len(xyz), np.bool_)
        timed = "gps_time" in record.point_format.dimension_names
        time_s = np.array(record.gps_time, np.float64) if timed else None
        return Part(xyz, bright, time_s=time_s, source=np.array(record.point_source_id, np.uint16))


def _useless(record: Any) -> npt.NDArray[np.bool_]:
    """Withheld, or classified as low (7) or high (18) noise."""
    kinds = np.asarray(record.classification)
    return np.asarray((kinds == 7) | (kinds == 18) | (np.asarray(record.withheld) != 0))


def _crs(path: Path, header: Any) -> pyproj.CRS | None:
    try:
        crs: pyproj.CRS | None = header.parse_crs()
    except (pyproj.exceptions.CRSError, laspy.LaspyException, ValueError):
        return None  # metres are assumed, and the extent is checked
    if crs is None:
        return None
    for axis in crs.axis_info:
        if axis.unit_name not in ("metre", "meter", ""):
            raise InventoryError(
                f"{path}: its coordinates are in {axis.unit_name} ({crs.name}); bring it into a projected reference "
                "system in metres, for example with `pdal translate` and filters.reprojection"
            )
    return crs
