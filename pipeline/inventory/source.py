"""A map as parts of points, near a whole origin, in bounded memory: double precision until the origin is off."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import laspy
import numpy as np
import numpy.typing as npt
import pyproj

from pipeline.inventory.errors import InventoryError

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
AT_ONCE = 1_000_000
LAS_REFLECTOR = 150 * 257
"""Intensity of a Mid-360's retro-reflector as our maps have it, on the scale of LAS."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Some points. xyz_m: (n, 3) from the map's origin. reflector: (n,), False where intensity says nothing.

    sensor_m: (n, 2) where the scanner stood, time_s: (n,) when it measured, source: (n,) the number of its recording,
    the last two as LAS has them; None where the map does not say.
    """

    xyz_m: Floats
    reflector: npt.NDArray[np.bool_]
    sensor_m: Floats | None = None
    time_s: Doubles | None = None
    source: npt.NDArray[np.uint16] | None = None


class MapSource(Protocol):
    """A map that can be read again and again. Its parts come in the same order each time."""

    @property
    def name(self) -> str: ...
    @property
    def count(self) -> int: ...
    @property
    def origin_m(self) -> Doubles:
        """(3,) whole metres, in `crs`."""

    @property
    def bounds_m(self) -> Doubles:
        """(2, 2) lowest and highest x, y from the origin."""

    @property
    def voxel_m(self) -> float:
        """One point was kept in each cube of this size; 0 where it is not known."""

    @property
    def crs(self) -> pyproj.CRS | None: ...
    def placed(self, xyz_m: Doubles) -> Doubles:
        """(n, 3) from the origin -> in `crs`, or the map's own coordinates."""

    def parts(self) -> Iterator[Part]: ...


def open_map(path: Path) -> MapSource:
    """Of a LAS, LAZ or PLY file. InventoryError when it is none, is damaged, empty, or not in metres."""
    from pipeline.inventory.ply import PlyMap  # noqa: PLC0415 - a kind of source that builds on this module

    kinds: dict[str, Callable[[Path], MapSource]] = {".las": LasMap, ".laz": LasMap, ".ply": PlyMap}
    kind = kinds.get(path.suffix.lower())
    if kind is None:
        raise InventoryError(f"{path}: expected a session, or a map as .las, .laz or .ply")
    if not path.is_file():
        raise InventoryError(f"{path}: there is no such file")
    return kind(path)


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
        bright = np.asarray(record.intensity) >= LAS_REFLECTOR if self._ours else np.zeros(len(xyz), np.bool_)
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


def check_extent(path: Path, low: Doubles, high: Doubles) -> None:
    """InventoryError for coordinates that cannot be metres of a forest."""
    wide = high - low
    if not np.isfinite(wide).all():
        raise InventoryError(f"{path}: its bounds are not finite; the header or the points are damaged")
    if max(wide[0], wide[1]) < 1.0:
        hint = "; are these degrees?" if abs(high[0]) <= 180.0 and abs(high[1]) <= 90.0 else ""
        raise InventoryError(f"{path}: it is {wide[0]:g} by {wide[1]:g} across, no forest in metres{hint}")
    if wide[2] > 20.0 * max(wide[0], wide[1], 100.0):
        raise InventoryError(f"{path}: {wide[2]:.0f} m high and {wide[0]:.0f} m wide; are its axes swapped?")
