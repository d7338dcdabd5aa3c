"""From two files to an alignment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyproj

from pipeline.alignment.align import Alignment, align
from pipeline.alignment.cloud import Batch, Cloud, batches, inspect
from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.errors import ApartError, FrameError
from pipeline.alignment.frames import Placed, check_heights, place
from pipeline.alignment.grid import Array, Grid
from pipeline.alignment.scene import Scene, Source, aerial_scene, stem_scene, terrestrial_scene
from pipeline.alignment.stem_table import read_stems
from pipeline.alignment.torch_kernels import kernels_on
from pipeline.alignment.transform import Transform

Stage = Callable[[str], Callable[[float], None]]
"""Begins a stage of the work; returns what takes its progress, 0..1."""
LARGEST_CELLS = 1_000_000
"""Of the fixed map: larger ones take coarser cells, which have more to tell anyhow."""
TABLE_MARGIN_M = 6.0
SESSIONS_OVERLAP, SESSIONS_KERNEL_M = 0.35, 0.7
"""Two walks share a part of the stand only; and both see the stems themselves."""


@dataclass(frozen=True, slots=True)
class Task:
    """start: where the terrestrial map lies in the aerial one's frame, if its coordinates are local. crs: of maps that
    name none. least_dbh_cm: thinner stems of a table are left out.
    """

    aerial: Path
    terrestrial: Path
    config: AlignmentConfig
    start: Transform | None = None
    crs: str | None = None
    least_dbh_cm: float = 0.0
    sessions: bool = False
    """`aerial` is a ground map too, in any frame: every turn is tried, and every shift that leaves enough overlap."""


@dataclass(frozen=True, slots=True, eq=False)
class Done:
    """The alignment is of the terrestrial map as it is `placed`. config: with the cell that was used."""

    alignment: Alignment
    fixed: Scene
    moved: Scene
    aerial: Cloud
    placed: Placed
    config: AlignmentConfig


def run(task: Task, stage: Stage) -> Done:
    """Raises `AlignmentError` of any kind."""
    kernels_on(task.config.device)  # whether it is there at all, before minutes of reading
    if task.sessions:
        return _run_sessions(task, stage)
    aerial = _named(inspect(task.aerial), task.crs)
    table = task.terrestrial.suffix.lower() in {".csv", ".txt"}
    ground = _table_cloud(task) if table else inspect(task.terrestrial)
    ground = _named(ground, task.crs if task.start is None else None)
    if aerial.crs is None:
        raise FrameError(f"{aerial.path}: names no coordinate system; name it with --crs EPSG:CODE")
    placed = place(aerial, ground, task.start, task.config.search_m)
    low, high = placed.corners()
    margin = TABLE_MARGIN_M if table else 0.0
    cell = _cell_m(low, high, task.config)
    config = replace(task.config, cell_m=cell)
    grid = Grid.over(low - margin, high + margin, cell)
    moved = _stems(task, placed, grid) if table else _ground(placed.batches, placed.cloud, grid, stage("ground map"))
    fixed = _aerial(aerial, moved, config, stage("aerial map"))
    return Done(align(fixed, moved, config, stage("search")), fixed, moved, aerial, placed, config)


def _run_sessions(task: Task, stage: Stage) -> Done:
    """Middle on middle at first."""
    first, second = inspect(task.aerial), inspect(task.terrestrial)
    here, there = ((one.low_m[:2] + one.high_m[:2]) / 2 for one in (second, first))
    x, y = here.tolist()
    start = task.start or Transform((x, y), *(there - here).tolist())
    placed = Placed(second, first.crs, start, ("stems on stems: neither map has to lie anywhere",))
    spans = [float(np.hypot(*(one.high_m - one.low_m)[:2])) for one in (first, second)]
    reach = (0.5 * sum(spans) - SESSIONS_OVERLAP * min(spans)) if task.start is None else task.config.search_m
    config = replace(task.config, search_m=reach, overlap=SESSIONS_OVERLAP, kernel_m=SESSIONS_KERNEL_M)
    config = config if task.start is not None else replace(config, search_deg=180.0)
    low, high = placed.corners()
    config = replace(config, cell_m=_cell_m(low, high, config))
    moved = _ground(placed.batches, second, Grid.over(low, high, config.cell_m), stage("ground map"))
    fixed = _ground(lambda: batches(first), first, _reached(moved, config), stage("other map"))
    return Done(align(fixed, moved, config, stage("search")), fixed, moved, first, placed, config)


def _cell_m(low: Array, high: Array, config: AlignmentConfig) -> float:
    side = float(np.hypot(*(high - low))) + 2 * config.search_m
    return max(config.cell_m, side / float(np.sqrt(LARGEST_CELLS)))


def _stems(task: Task, placed: Placed, grid: Grid) -> Scene:
    stems = read_stems(task.terrestrial, task.least_dbh_cm)
    return stem_scene(placed.points(stems.places_m), stems.weights, grid)


def _ground(read: Source, cloud: Cloud, grid: Grid, advance: Callable[[float], None]) -> Scene:
    """It is read twice."""
    starts = iter((0.0, 0.5))

    def source() -> Iterator[Batch]:
        before = next(starts)
        return _counted(read(), cloud.count, lambda share: advance(before + 0.5 * share))

    return terrestrial_scene(source, grid)


def _counted(some: Iterable[Batch], count: int, advance: Callable[[float], None]) -> Iterator[Batch]:
    done = 0
    for batch in some:
        yield batch
        done += len(batch)
        advance(min(done / count, 1.0))


def _aerial(cloud: Cloud, moved: Scene, config: AlignmentConfig, advance: Callable[[float], None]) -> Scene:
    grid = _reached(moved, config)
    fixed = aerial_scene(lambda: _counted(batches(cloud), cloud.count, advance), grid)
    if not fixed.covered.any() or fixed.canopy_m is None:
        raise ApartError(f"{cloud.path}: has no points within {config.search_m:g} m of the ground map")
    check_heights(cloud.path, fixed.canopy_m)
    return fixed


def _reached(moved: Scene, config: AlignmentConfig) -> Grid:
    """What the search can lay the moved map on."""
    radius = 0.5 * float(np.hypot(*moved.grid.shape)) * moved.grid.cell_m + config.search_m + config.cell_m
    return Grid.over(moved.grid.middle_m - radius, moved.grid.middle_m + radius, config.cell_m)


def _named(cloud: Cloud, crs: str | None) -> Cloud:
    if crs is None:
        return cloud
    try:
        named = pyproj.CRS.from_user_input(crs)
    except pyproj.exceptions.CRSError as error:
        raise FrameError(
            f"--crs {crs}: no coordinate system is known by that name; write EPSG:32612, for example"
        ) from error
    return cloud if cloud.crs is not None else replace(cloud, crs=named)


def _table_cloud(task: Task) -> Cloud:
    """What a table would say of itself if it were a cloud."""
    places = read_stems(task.terrestrial, task.least_dbh_cm).places_m
    low, high = (np.append(corner, 0.0) for corner in (places.min(axis=0), places.max(axis=0)))
    return Cloud(task.terrestrial, len(places), low, high, None)
