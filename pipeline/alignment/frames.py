"""Two files on one coordinate system in metres, or a clear word why that is not possible."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyproj

from pipeline.alignment.cloud import AT_ONCE, Batch, Cloud, batches
from pipeline.alignment.errors import ApartError, FrameError
from pipeline.alignment.grid import Array
from pipeline.alignment.transform import Transform

FOOT_M = 0.3048


@dataclass(frozen=True)
class Placed:
    """The moved map on the coordinates of the fixed one, as its maker or the user put it.

    start: from its own frame, where that is local. notes: what was assumed.
    """

    cloud: Cloud
    fixed_crs: pyproj.CRS | None
    start: Transform | None
    notes: tuple[str, ...]

    def batches(self, at_once: int = AT_ONCE) -> Iterator[Batch]:
        """As of `cloud.batches`, placed."""
        for batch in batches(self.cloud, at_once):
            yield replace(batch, xyz_m=self.points(batch.xyz_m))

    def points(self, xyz: Array) -> Array:
        """(n, 2 or 3) of its own frame -> on the fixed one's coordinates."""
        if self.start is not None:
            return self.start.apply(xyz)
        if self._projector is None:
            return xyz
        return np.column_stack([*self._projector.transform(xyz[:, 0], xyz[:, 1]), *xyz[:, 2:].T])

    def corners(self) -> tuple[Array, Array]:
        """(2,) low and high."""
        low, high = self.cloud.low_m, self.cloud.high_m
        found = self.points(np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])]))
        return found.min(axis=0), found.max(axis=0)

    @property
    def converted(self) -> bool:
        """From another coordinate system."""
        return self._projector is not None

    @cached_property
    def _projector(self) -> pyproj.Transformer | None:
        if self.cloud.crs is None or self.fixed_crs is None:
            return None
        here, there = flat(self.cloud.crs), flat(self.fixed_crs)
        return None if here == there else pyproj.Transformer.from_crs(here, there, always_xy=True)


def place(fixed: Cloud, moved: Cloud, start: Transform | None, search_m: float) -> Placed:
    """Raises `FrameError` where coordinate systems, units or axes do not fit, `ApartError` where maps do not meet."""
    if fixed.crs is not None:
        check_crs(fixed)
    if start is not None:
        found = Placed(moved, fixed.crs, start, ("placed by the start that was given",))
    elif moved.crs is not None and fixed.crs is not None:
        check_crs(moved)
        found = Placed(moved, fixed.crs, None, _conversion(moved.crs, fixed.crs))
    else:
        found = Placed(moved, fixed.crs, None, _unnamed(fixed, moved))
    _check_apart(fixed, found, search_m)
    return found


def check_crs(cloud: Cloud) -> None:
    """Projected, in metres, heights included."""
    assert cloud.crs is not None
    if cloud.crs.is_geographic or cloud.crs.is_geocentric:
        raise FrameError(
            f"{cloud.path}: its coordinate system is {cloud.crs.name}, in degrees or geocentric; "
            "reproject it to a projected one in metres (UTM, for example)"
        )
    for axis in cloud.crs.axis_info:
        if axis.unit_conversion_factor != 1.0:
            raise FrameError(
                f"{cloud.path}: its coordinate system {cloud.crs.name} has {axis.name.lower()} in {axis.unit_name}; "
                "convert it to one in metres, heights included"
            )


def check_heights(path: object, canopy_m: Array) -> None:
    """No forest on Earth stands 116 m above its ground: then the heights are in feet."""
    top = float(np.percentile(canopy_m[canopy_m > 2.0], 90)) if (canopy_m > 2.0).any() else 0.0
    if top > 75.0:
        raise FrameError(
            f"{path}: its canopy stands {top:.0f} high, which is no forest in metres, but {top * FOOT_M:.0f} m if its "
            "heights are in feet; convert them to metres"
        )


def flat(crs: pyproj.CRS) -> pyproj.CRS:
    """Without heights: grids of geoids are not at hand everywhere, and the ground tells the shift."""
    return crs.sub_crs_list[0] if crs.is_compound else crs.to_2d()


def _conversion(moved: pyproj.CRS, fixed: pyproj.CRS) -> tuple[str, ...]:
    here, there = flat(moved), flat(fixed)
    return () if here == there else (f"converted from {here.name} to {there.name}; heights as they are",)


def _unnamed(fixed: Cloud, moved: Cloud) -> tuple[str, ...]:
    if fixed.crs is None and moved.crs is None:
        return ("neither map names its coordinate system: taken for the same, in metres",)
    mute = fixed if fixed.crs is None else moved
    return (f"{mute.path.name} names no coordinate system: taken for that of the other map",)


def _check_apart(fixed: Cloud, placed: Placed, search_m: float) -> None:
    low, high = placed.corners()
    if _meets(fixed, low, high, search_m):
        return
    path = placed.cloud.path
    if _meets(fixed, low[::-1], high[::-1], search_m):
        raise FrameError(
            f"{path}: its x lies where the y of {fixed.path} does, and its y where x does: axes are swapped; "
            "exchange them in one of the two"
        )
    for factor, feet in ((FOOT_M, path), (1.0 / FOOT_M, fixed.path)):
        if _meets(fixed, low * factor, high * factor, search_m):
            raise FrameError(f"{feet}: fits the other map when taken for feet; convert it to metres")
    gap = np.maximum(np.maximum(fixed.low_m[:2] - high, low - fixed.high_m[:2]), 0.0)
    local = placed.cloud.crs is None and placed.start is None and fixed.crs is not None
    raise ApartError(
        f"{path}: lies {float(np.hypot(*gap)) / 1000.0:,.1f} km from {fixed.path}; "
        + (
            "it names no coordinate system: say where its origin lies with --start X,Y[,YAW]"
            if local
            else "check that both are of one place, and their coordinate systems"
        )
    )


def _meets(fixed: Cloud, low: Array, high: Array, search_m: float) -> bool:
    return bool(np.all(low - search_m <= fixed.high_m[:2]) and np.all(high + search_m >= fixed.low_m[:2]))
