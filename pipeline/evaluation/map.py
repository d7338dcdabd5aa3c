"""The quality of a map: sharpness, stems, passes that overlap, a reference, surveyed points. A cell at a time."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from pipeline.evaluation.control import (
    REACH_M,
    ControlErrors,
    ControlPoint,
    ControlResidual,
    Surroundings,
    control_errors,
    residual,
)
from pipeline.evaluation.errors import ControlError, EvaluationError
from pipeline.evaluation.map_store import MapStore
from pipeline.evaluation.sharpness import Apart, Around, apart, around
from pipeline.inventory.config import InventoryConfig
from pipeline.inventory.inventory import Inventory, take_inventory
from pipeline.inventory.source import MapSource
from pipeline.inventory.stem import BREAST_M, Stem

Doubles = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]
STEM_M = (0.7, 5.0)
"""Heights of the bark that is looked at."""
BARK_M = 0.15
"""Beyond this from the fitted bark a point is something else; a spread of 0.11 m says only that."""
LEAST_BARK, LEAST_DBH_M = 50, 0.1
"""Of thinner stems the far side is within reach."""
_UNTIMED = "the points carry no time, and no number of their recording"
_SHARES = (0.5, 0.6)
"""Of the work, when stems are found, and when the points wait on the disk."""


@dataclass(frozen=True, slots=True)
class Asked:
    """gap_s: points measured further apart in time are of two passes. places: looked at, evenly over the points."""

    radius_m: float = 0.3
    gap_s: float = 30.0
    control: Sequence[ControlPoint] = ()
    places: int = 60_000


class Sharpness(msgspec.Struct, frozen=True):
    """entropy: mean map entropy; plane_m: mean plane variance, a length; surface_m: the same, of the places that are
    surfaces at all, whose share is surfaces. NaN without places."""

    radius_m: float
    places: int
    entropy: float
    plane_m: float
    surface_m: float
    surfaces: float


class Bark(msgspec.Struct, frozen=True):
    """Robust sigma of the bark about fitted stems: median, and the worst tenth begins."""

    stems: int
    thickness_m: float
    thickness_90_m: float


class Overlap(msgspec.Struct, frozen=True):
    """Distances of surfaces: median and 95th percentile of their size; up_m: median of level ones, signed, the later
    pass less the earlier, or the map less its reference. NaN without places."""

    places: int
    median_m: float
    p95_m: float
    up_m: float
    why: str = ""
    """There are none."""


class MapQuality(msgspec.Struct, frozen=True):
    """overlap: of passes of the map. reference: None where no other map was given; so with control."""

    map: str
    points: int
    sharpness: Sharpness
    bark: Bark
    overlap: Overlap
    reference: Overlap | None = None
    control: ControlErrors | None = None


def map_quality(
    source: MapSource,
    asked: Asked,
    reference: MapSource | None = None,
    advance: Callable[[float], None] = lambda _: None,
) -> MapQuality:
    """InventoryError for maps, EvaluationError for a reference or control points that cannot be put beside the map."""
    beside = None if reference is None else _beside(source, reference)
    places = [_placed(source, point) for point in asked.control]
    inventory = take_inventory(source, InventoryConfig(), lambda share: advance(_SHARES[0] * share))
    with tempfile.TemporaryDirectory(prefix="mapforest-quality-") as folder:
        store = MapStore(Path(folder))
        for part in source.parts():
            store.add(part, max(1, source.count // asked.places))
        if reference is not None:
            for part in reference.parts():
                store.add(part, 0, beside)
        store.flush()
        advance(_SHARES[1])
        looked = _look(store, asked, lambda share: advance(_SHARES[1] + (1.0 - _SHARES[1]) * share))
        bark = _bark(store, inventory.stems)
        residuals = [_residual(store, inventory, *one) for one in zip(asked.control, places, strict=True)]
    return MapQuality(
        source.name,
        source.count,
        _sharpness(looked.around, asked),
        bark,
        _overlap(looked.passes, f"nothing was seen twice, {asked.gap_s:g} s apart" if looked.timed else _UNTIMED),
        None if reference is None else _overlap(looked.beside, "the reference has no surface where the map has one"),
        control_errors(residuals) if asked.control else None,
    )


@dataclass(eq=False)
class _Looked:
    """What all cells told. timed: there is something that tells passes apart."""

    around: list[Around] = field(default_factory=list)
    passes: list[Apart] = field(default_factory=list)
    beside: list[Apart] = field(default_factory=list)
    timed: bool = False


def _look(store: MapStore, asked: Asked, advance: Callable[[float], None]) -> _Looked:
    looked = _Looked()
    for share, points in store.cells(asked.radius_m):
        advance(share)
        xyz, mine = points["xyz"].astype(np.float64), ~points["reference"]
        chosen = np.flatnonzero(points["chosen"])
        own = _Own.of(points[mine])
        looked.timed |= own.timed
        looked.around.append(around(xyz[mine], own.chosen, asked.radius_m))
        if own.timed:
            looked.passes.append(apart(xyz[mine], own.chosen, own.other(asked.gap_s), own.order, asked.radius_m))
        if not mine.all():
            looked.beside.append(apart(xyz, chosen, _reference(mine), 1.0 * mine, asked.radius_m))
    return looked


def _reference(mine: npt.NDArray[np.bool_]) -> Callable[[Rows, Rows], npt.NDArray[np.bool_]]:
    return lambda rows, _: ~mine[rows]


@dataclass(frozen=True, slots=True, eq=False)
class _Own:
    """The map's own points around a cell. order: (n,) time, or the number of the recording."""

    chosen: Rows
    time_s: Doubles
    number: npt.NDArray[np.uint16]
    order: Doubles
    timed: bool

    @classmethod
    def of(cls, points: npt.NDArray[np.void]) -> _Own:
        time_s, number = points["time_s"], points["source"]
        told = bool(np.isfinite(time_s).all() and np.ptp(time_s) > 0.0) if len(points) else False
        order = time_s if told else number.astype(np.float64)
        several = len(points) > 0 and bool((number != number[0]).any())
        return cls(np.flatnonzero(points["chosen"]), time_s, number, order, told or several)

    def other(self, gap_s: float) -> Callable[[Rows, Rows], npt.NDArray[np.bool_]]:
        """Another recording, or a time further apart; NaN is no time."""
        return lambda rows, places: (
            (self.number[rows] != self.number[places]) | (np.abs(self.time_s[rows] - self.time_s[places]) > gap_s)
        )


def _sharpness(found: Sequence[Around], asked: Asked) -> Sharpness:
    entropy = np.concatenate([one.entropy for one in found])
    thickness = np.concatenate([one.thickness_m for one in found])
    flat = np.concatenate([one.flat for one in found])
    means = (_mean(entropy), _mean(thickness), _mean(thickness[flat]), _mean(flat))
    return Sharpness(asked.radius_m, len(entropy), *means)


def _overlap(found: Sequence[Apart], why: str) -> Overlap:
    distance = np.concatenate([np.empty(0), *(one.distance_m for one in found)])
    if not len(distance):
        return Overlap(0, float("nan"), float("nan"), float("nan"), why)
    level = distance[np.concatenate([one.level for one in found])]
    median, p95 = np.percentile(np.abs(distance), [50.0, 95.0])
    return Overlap(len(distance), float(median), float(p95), float(np.median(level)) if len(level) else float("nan"))


def _mean(values: npt.NDArray[Any]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _bark(store: MapStore, stems: Sequence[Stem]) -> Bark:
    thick = [stem for stem in stems if stem.fitted_dbh_m >= LEAST_DBH_M]
    spreads = [spread for stem in thick if np.isfinite(spread := bark_spread(store, stem))]
    if not spreads:
        return Bark(0, float("nan"), float("nan"))
    median, worst = np.percentile(spreads, [50.0, 90.0])
    return Bark(len(spreads), float(median), float(worst))


def bark_spread(store: MapStore, stem: Stem) -> float:
    """1.4826 times the median deviation of the points from the stem's own cone; NaN where there are few."""
    radius = 0.5 * stem.fitted_dbh_m
    reach = radius + BARK_M + STEM_M[1] * float(np.hypot(*stem.lean))
    xyz = store.near(stem.axis_at(BREAST_M), reach)["xyz"].astype(np.float64)
    height = xyz[:, 2] - stem.base_m[2]
    axis = stem.base_m[:2] + height[:, None] * stem.lean
    off = np.hypot(*(xyz[:, :2] - axis).T) - (radius + stem.taper * (height - BREAST_M))
    off = off[(height > STEM_M[0]) & (height < STEM_M[1]) & (np.abs(off) < BARK_M)]
    return 1.4826 * float(np.median(np.abs(off - np.median(off)))) if len(off) >= LEAST_BARK else float("nan")


def _placed(source: MapSource, point: ControlPoint) -> Doubles:
    """(3,) from the map's origin. EvaluationError for a point beside the map."""
    at: Doubles = np.array([point.x, point.y, point.z]) - source.placed(np.zeros((1, 3)))[0]
    low, high = source.bounds_m
    if (at[:2] < low).any() or (at[:2] > high).any():
        first, last = (source.placed(np.append(corner, 0.0)[None])[0] for corner in (low, high))
        raise ControlError(
            f"{point.name} at {point.x:.1f} {point.y:.1f} is not on the map, which goes from {first[0]:.1f} "
            f"{first[1]:.1f} to {last[0]:.1f} {last[1]:.1f}: are both in the same coordinates?"
        )
    return at


def _residual(store: MapStore, inventory: Inventory, point: ControlPoint, at: Doubles) -> ControlResidual:
    points = store.near(at[:2], 2.0 * REACH_M)
    return residual(point, at, Surroundings(points["xyz"].astype(np.float64), points["reflector"], inventory.terrain))


def _beside(source: MapSource, reference: MapSource) -> Doubles:
    """(3,) the reference's origin from the map's. EvaluationError where they do not overlap."""
    if source.crs is not None and reference.crs is not None and source.crs.to_2d() != reference.crs.to_2d():
        raise EvaluationError(
            f"{reference.name} is in {reference.crs.name}, {source.name} in {source.crs.name}: bring both into one"
        )
    shift = reference.placed(np.zeros((1, 3)))[0] - source.placed(np.zeros((1, 3)))[0]
    theirs = reference.bounds_m + shift[:2]
    if (theirs[0] > source.bounds_m[1]).any() or (theirs[1] < source.bounds_m[0]).any():
        raise EvaluationError(f"{reference.name} lies beside {source.name}: are both in the same coordinates?")
    return np.asarray(shift)
