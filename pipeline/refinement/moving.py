"""Points of what moved: hit for a moment, and looked through before or after.

Each point of the map is a ray from where the sensor was. A cell that stopped the beams for a moment only, and that
beams of other moments passed, held something that moved; so in Removert (Kim, Kim 2020) and DUFOMap (Duberg et al.
2024). A map that keeps the first point in each voxel hides that a stem was hit again: the submaps, which do not, tell
what was there at another time. What moves is large besides: single cells at the rim of a stem are none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from pipeline.estimates import Array
from pipeline.products.tiles import Tile, read_tile, tiles
from pipeline.products.track import Placement
from pipeline.refinement.config import MovingConfig
from pipeline.refinement.moving_kernels import hit, look_through
from pipeline.refinement.submaps import LENGTH_M, REACH_M, Submap

CELL_M = 0.1
COARSE = 2
"""Cells along an axis to one in which the submaps tell of other times."""
REGION_M, MARGIN_M = 16.0, 1.0
RAYS = 1_500_000
"""Through one region, at most: each n-th of more."""
_BELOW_M, _ABOVE_M = 3.0, 1.5
"""Of the sensor: what moves is not higher, and crowns do move."""
_RAY = np.dtype([("xyz", "<f4", 3), ("sweep", "<u4"), ("ordinal", "<u4")])
Mask = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A session's map: tiles of one point a voxel; its track (n,) of ESTIMATE and where that lies; its submaps."""

    tiles: Path
    voxel_m: float
    track: npt.NDArray[np.void]
    placement: Placement
    submaps: Sequence[Submap]


def moved(
    seen: Seen, config: MovingConfig, work: Path, advance: Callable[[float], None] = lambda _: None
) -> dict[Tile, Mask]:
    """Which points of each tile, as they are read, are of what moved. work: an empty folder; a region is in memory at a
    time, with the rays that cross it."""
    counts = dict(_sorted_out(seen, work))
    out = np.zeros(sum(counts.values()), np.bool_)
    regions = sorted(_number(path) for path in work.glob("*.rays"))
    walk = _Walk(seen)
    for k, region in enumerate(regions):
        out[_of_region(region, work, walk, config)] = True
        advance((k + 1) / len(regions))
    ends = np.cumsum(list(counts.values()))
    return {tile: out[end - counts[tile] : end] for tile, end in zip(counts, ends.tolist(), strict=True)}


class _Walk:
    """Where the sensor was at each sweep and when; and what the submaps show."""

    def __init__(self, seen: Seen) -> None:
        self.places_m, _ = seen.placement.poses(seen.track)
        stamps = seen.track["stamp_ns"].astype(np.int64)
        self.times_ms = ((stamps - stamps[0]) // 1_000_000).astype(np.int32)
        self.begins = np.array([one.first for one in seen.submaps], np.int64)
        self._submaps, self._placement = seen.submaps, seen.placement
        self._middles = self.places_m[[one.middle for one in seen.submaps]]

    def around(self, low: Array, high: Array) -> Iterator[tuple[int, Array]]:
        """Submaps by number, and their points (n, 3), of which some may lie in a box."""
        low, high = low[:2] - REACH_M - LENGTH_M, high[:2] + REACH_M + LENGTH_M
        near = ((self._middles[:, :2] > low) & (self._middles[:, :2] < high)).all(axis=1)
        for k in np.flatnonzero(near).tolist():
            points = self._submaps[k].points().astype(np.float64)
            yield k, self._placement.points(points, np.full(len(points), self._submaps[k].middle))


def _sorted_out(seen: Seen, work: Path) -> Iterator[tuple[Tile, int]]:
    """Every point, where it is on the map, into the file of its region; how many each tile has."""
    ordinal = 0
    for tile in tiles(seen.tiles):
        points = read_tile(seen.tiles, tile, seen.voxel_m)
        rays = np.empty(len(points), _RAY)
        sweeps = points["sweep"].astype(np.int64)
        rays["xyz"] = seen.placement.points(points["xyz"].astype(np.float64), sweeps)
        rays["sweep"], rays["ordinal"] = sweeps, ordinal + np.arange(len(points))
        where = np.floor(rays["xyz"][:, :2] / REGION_M).astype(np.int64)
        for region in np.unique(where, axis=0):
            with _path(work, *region.tolist()).open("ab") as file:
                file.write(rays[(where == region).all(axis=1)].tobytes())
        ordinal += len(points)
        yield tile, len(points)


def _of_region(region: Tile, work: Path, walk: _Walk, config: MovingConfig) -> npt.NDArray[np.int64]:
    """Ordinals of its points that are of what moved."""
    x, y = region
    rays = _read(work, [(x + i, y + j) for i in range(-2, 3) for j in range(-2, 3)])
    low, high = np.array(region) * REGION_M - MARGIN_M, (np.array(region) + 1) * REGION_M + MARGIN_M
    heights = walk.places_m[np.unique(rays["sweep"]), 2]
    box = _Box.over(np.append(low, heights.min() - _BELOW_M), np.append(high, heights.max() + _ABOVE_M))
    own = rays[box.holds(rays["xyz"])]
    if not len(own):
        return np.empty(0, np.int64)
    cells = box.cells(own["xyz"].astype(np.float64))
    first, last, count = (np.zeros(box.size, np.int32) for _ in range(3))
    hit(cells, walk.times_ms[own["sweep"]], first, last, count)
    brief = np.flatnonzero((count > 0) & (last - first <= round(1000 * config.stays_s)))
    spans = np.column_stack([first, last])
    asked = np.zeros(box.size, np.bool_)
    asked[brief[~_at_other_times(box, walk, brief, spans[brief])]] = True
    if asked.sum() < config.least_cells:
        return np.empty(0, np.int64)
    spans[~asked] = (1, 0)
    through = _looked(rays[:: len(rays) // RAYS + 1], box, walk, spans, round(1000 * config.apart_s))
    open_ = asked & (through[:, 0] >= config.rays) & (through[:, 1] >= config.moments) & (through[:, 2] <= count)
    large = _large(open_.reshape(box.shape), config)
    rim = ndimage.binary_dilation(large, np.ones((3, 3, 3), np.bool_)).ravel() & asked & (through[:, 0] > 0)
    mine = (np.floor(own["xyz"][:, :2] / REGION_M) == region).all(axis=1)
    found: npt.NDArray[np.int64] = own["ordinal"][mine & (rim | large.ravel())[cells]].astype(np.int64)
    return found


def _at_other_times(box: _Box, walk: _Walk, asked: npt.NDArray[np.int64], spans: Ints) -> Mask:
    """(k,) of cells (k,) hit from first to last (k, 2): whether a submap that was walked before or after that shows
    something there too."""
    coarse = _Box(box.low, COARSE * CELL_M, tuple(-(-side // COARSE) for side in box.shape))
    least, most = np.full(coarse.size, 1 << 20, np.int32), np.full(coarse.size, -1, np.int32)
    for number, points in walk.around(box.low, box.high):
        there = np.unique(coarse.cells(points[coarse.holds(points)]))
        least[there], most[there] = np.minimum(least[there], number), np.maximum(most[there], number)
    owner = np.searchsorted(walk.begins, np.searchsorted(walk.times_ms, spans), "right") - 1
    index, found = np.column_stack(np.unravel_index(asked, box.shape)), np.zeros(len(asked), np.bool_)
    nearer = np.where(index % COARSE, 1, -1)
    for corner in np.ndindex(2, 2, 2):
        near = np.clip(index // COARSE + np.array(corner) * nearer, 0, np.array(coarse.shape) - 1)
        at = np.ravel_multi_index(tuple(near.T), coarse.shape)
        found |= (least[at] < owner[:, 0]) | (most[at] > owner[:, 1])
    return found


def _looked(rays: npt.NDArray[np.void], box: _Box, walk: _Walk, spans: Ints, around_ms: int) -> Ints:
    """(cells, 3) as `look_through` has it."""
    rays = rays[np.argsort(rays["sweep"], kind="stable")]
    begins, ends = walk.places_m[rays["sweep"]], rays["xyz"].astype(np.float64)
    seen = np.zeros((box.size, 3), np.int32)
    look_through(begins, ends, walk.times_ms[rays["sweep"]], box.low, box.cell_m, box.shape, spans, around_ms, seen)
    return seen


def _large(open_: Mask, config: MovingConfig) -> Mask:
    """Of cells (nx, ny, nz), those that make something as large as what moves."""
    labels, count = ndimage.label(open_, np.ones((3, 3, 3)))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    tall = [0, *(box[2].stop - box[2].start for box in ndimage.find_objects(labels))]
    kept = (sizes >= config.least_cells) & (np.array(tall) * CELL_M >= config.least_height_m)
    kept[0] = False
    return np.asarray(kept[labels])


@dataclass(frozen=True, slots=True, eq=False)
class _Box:
    """Cells in space, flat index last axis first."""

    low: Array
    cell_m: float
    shape: tuple[int, ...]

    @classmethod
    def over(cls, low: Array, high: Array) -> _Box:
        return cls(low, CELL_M, tuple(np.ceil((high - low) / CELL_M).astype(int).tolist()))

    @property
    def size(self) -> int:
        return int(np.prod(self.shape))

    @property
    def high(self) -> Array:
        return np.asarray(self.low + self.cell_m * np.array(self.shape))

    def holds(self, points: npt.NDArray[np.floating]) -> Mask:
        return np.asarray(((points >= self.low) & (points < self.high)).all(axis=1))

    def cells(self, points: Array) -> npt.NDArray[np.int64]:
        """(n,) of points that it holds."""
        index = np.minimum(((points - self.low) / self.cell_m).astype(np.int64), np.array(self.shape) - 1)
        return np.asarray((index[:, 0] * self.shape[1] + index[:, 1]) * self.shape[2] + index[:, 2])


def _read(work: Path, regions: Sequence[Tile]) -> npt.NDArray[np.void]:
    parts = [np.fromfile(path, _RAY) for path in (_path(work, *region) for region in regions) if path.exists()]
    return np.concatenate(parts)


def _path(work: Path, x: int, y: int) -> Path:
    return work / f"{x}_{y}.rays"


def _number(path: Path) -> Tile:
    x, y = path.stem.split("_")
    return int(x), int(y)
