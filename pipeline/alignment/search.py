"""Every turn and every shift within bounds, and what answers there are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from pipeline.alignment.correlate import shift_sums, turned, window
from pipeline.alignment.grid import Array, Grid, Mask
from pipeline.alignment.layers import Layer

Advance = Callable[[float], None]
FINEST_DEG = 0.25
COARSER = 2
"""Cells of a map to one of the sweep, along each axis: crowns are metres wide, and it takes an eighth of the time."""


@dataclass(frozen=True, slots=True, eq=False)
class Maps:
    """Layers on the grids of the fixed and of the moved map; pivot_m: (2,) in the frame of the fixed one."""

    layers: Sequence[Layer]
    fixed: Grid
    moving: Grid
    pivot_m: Array


@dataclass(frozen=True, slots=True, eq=False)
class Landscape:
    """scores: (turns, shifts, shifts) nats, shifted along x and along y."""

    yaws_deg: Array
    shifts_m: Array
    scores: npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Candidate:
    """A pose of the moved map about the pivot, with its score."""

    x_m: float
    y_m: float
    yaw_deg: float
    nats: float

    def apart(self, other: Candidate) -> tuple[float, float]:
        """Metres, degrees."""
        turn = (self.yaw_deg - other.yaw_deg + 180.0) % 360.0 - 180.0
        return float(np.hypot(self.x_m - other.x_m, self.y_m - other.y_m)), abs(turn)


def sweep(maps: Maps, search_m: float, search_deg: float, overlap: float, advance: Advance) -> Landscape:
    """The joint score of all layers at every turn, and by FFT at every shift; -inf where too little overlaps."""
    cell, reach = maps.fixed.cell_m, int(np.ceil(search_m / maps.fixed.cell_m))
    yaws = turns(maps, search_deg)
    windows = [window(one.fixed, one.known, maps.fixed, reach) for one in maps.layers]
    scores = np.empty((len(yaws), 2 * reach + 1, 2 * reach + 1), np.float32)
    for k, yaw in enumerate(yaws.tolist()):
        total, least = np.zeros(scores.shape[1:]), np.ones(scores.shape[1:], np.bool_)
        for one, at in zip(maps.layers, windows, strict=True):
            sums = shift_sums(at, *turned(one, maps.moving, maps.fixed, maps.pivot_m, yaw))
            total += one.nats(sums)
            least &= sums[..., 0] >= overlap * one.seen.sum()
        scores[k] = np.where(least, total, -np.inf)
        advance((k + 1) / len(yaws))
    return Landscape(yaws, cell * np.arange(-reach, reach + 1, dtype=np.float64), scores)


def coarser(maps: Maps, times: int) -> Maps:
    """The same with cells `times` as large, each the mean of what is known in it."""
    fixed, moving = (
        Grid(one.origin_m, one.cell_m * times, (-(-one.shape[0] // times), -(-one.shape[1] // times)))
        for one in (maps.fixed, maps.moving)
    )
    layers = []
    for one in maps.layers:
        below, known = _averaged(one.fixed, one.known, times)
        above, seen = _averaged(one.moving, one.seen, times)
        share = min(one.independent * times**2, 1.0)
        layers.append(replace(one, fixed=below, known=known, moving=above, seen=seen, independent=share))
    return Maps(layers, fixed, moving, maps.pivot_m)


def _averaged(field: Array, mask: Mask, times: int) -> tuple[Array, Mask]:
    room = [(0, -size % times) for size in field.shape]
    total, count = (
        np.add.reduceat(
            np.add.reduceat(np.pad(one, room), range(0, one.shape[0], times), axis=0),
            range(0, one.shape[1], times),
            axis=1,
        )
        for one in (np.where(mask, field, 0.0), mask.astype(np.float64))
    )
    known = count >= 0.5 * times**2
    return np.where(known, total / np.maximum(count, 1.0), 0.0), known


def turns(maps: Maps, search_deg: float) -> Array:
    """Degrees, so close that the rim of the moved map goes by less than a cell and a half."""
    radius = max(0.5 * float(np.hypot(*maps.moving.shape)), 1.0)
    step = float(np.clip(np.degrees(1.5 / radius), FINEST_DEG, 2.0))
    count = int(np.ceil(search_deg / step))
    if search_deg >= 180.0:
        return np.linspace(-180.0, 180.0, 2 * count, endpoint=False)
    return np.linspace(-search_deg, search_deg, 2 * count + 1)


def candidates(found: Landscape, most: int) -> list[Candidate]:
    """Local maxima of the landscape, best first."""
    scores = found.scores
    whole_circle = found.yaws_deg[-1] - found.yaws_deg[0] > 350.0
    top = ndimage.maximum_filter(scores, size=3, mode=["wrap" if whole_circle else "nearest", "nearest", "nearest"])
    peaks = np.flatnonzero((scores == top).ravel() & (scores.ravel() > 0.0))
    peaks = peaks[np.argsort(-scores.ravel()[peaks], kind="stable")][:most]
    where = np.column_stack(np.unravel_index(peaks, scores.shape)).tolist()
    return [
        Candidate(float(found.shifts_m[x]), float(found.shifts_m[y]), float(found.yaws_deg[k]), float(scores[k, x, y]))
        for k, x, y in where
    ]
