"""A map as parts of points, near a whole origin, in bounded memory: double precision until the origin is off."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt
import pyproj

from pipeline.inventory.errors import InventoryError

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
AT_ONCE = 1_000_000


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
