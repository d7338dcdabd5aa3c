"""What moved is found by the rays that passed where it was; what stands stays."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.products.tiles import TileStore, read_tile, tiles
from pipeline.products.track import Placement, estimate_of
from pipeline.refinement.config import MovingConfig
from pipeline.refinement.moving import Seen, moved
from pipeline.refinement.moving_kernels import SHORT_M, look_through
from pipeline.refinement.submaps import SubmapWriter, read_submaps
from tests.pipeline.refinement import walks

VOXEL_M, EYE_M = 0.05, 1.3
STEMS = np.array([(x, y) for x in (-1.0, 6.0, 13.0) for y in (-4.0, 5.0)])


def cast(origin, rays, cylinders):
    """(n, 3) where rays (n, 3) of unit length end: on upright cylinders (x, y, radius, top), the ground, or a wall."""
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(rays[:, 2] < 0.0, -origin[2] / rays[:, 2], np.inf)
        reach = np.minimum(reach, (9.0 - np.sign(rays[:, 1]) * origin[1]) / np.abs(rays[:, 1]))
        level = np.linalg.norm(rays[:, :2], axis=1)
        for x, y, radius, top in cylinders:
            along = rays[:, :2] @ (np.array([x, y]) - origin[:2]) / level
            aside = np.sum((np.array([x, y]) - origin[:2]) ** 2) - along**2
            at = (along - np.sqrt(np.maximum(radius**2 - aside, 0.0))) / level
            met = (aside < radius**2) & (along > 0.0) & (origin[2] + at * rays[:, 2] < top)
            reach = np.where(met, np.minimum(reach, at), reach)
    ends = origin + reach[:, None] * rays
    return ends[reach < 14.0]


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """12 m along x in 14 s; somebody crosses the way in front, and then is gone. The map, its
    points of who moved marked by their intensity."""
    folder, random = tmp_path_factory.mktemp("walk"), np.random.default_rng(4)
    seconds = np.arange(0.0, 14.0, 0.2)
    way = (seconds, np.column_stack([0.9 * seconds, 0.0 * seconds, 0.0 * seconds]), 0.0 * seconds)
    track = walks.odometry(*way, drift_m=0.0, drift_yaw_deg=0.0)
    store, submaps = TileStore(folder / "tiles", 16.0, VOXEL_M), SubmapWriter(folder / "submaps")
    for k, second in enumerate(seconds):
        up, around = random.uniform(-0.6, 0.5, 4000), random.uniform(0.0, 2.0 * np.pi, 4000)
        rays = np.column_stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
        someone = (5.0, -3.5 + 1.2 * (second - 2.0), 0.25, 1.8)
        world = [(x, y, 0.15, 9.0) for x, y in STEMS] + ([someone] if 2.0 < second < 8.0 else [])
        ends = cast(way[1][k] + [0.0, 0.0, EYE_M], rays, world)
        of_someone = np.linalg.norm(ends[:, :2] - someone[:2], axis=1) < 0.26
        intensity = np.where(of_someone & (ends[:, 2] > 0.02), 100.0, 10.0)
        cloud = np.column_stack([ends - [0.0, 0.0, EYE_M], intensity]).astype(np.float32)
        store.add(cloud, k)
        submaps.add(estimate_of(track[k]), cloud, k)
    store.close()
    submaps.close()
    placement = Placement.upright(None, np.zeros((len(track), 3)), np.zeros(len(track)), np.zeros((len(track), 6, 6)))
    return Seen(folder / "tiles", VOXEL_M, track, placement, read_submaps(folder / "submaps"))


def test_who_crossed_the_way_is_gone_and_what_stands_is_there(session, tmp_path):
    found = moved(session, MovingConfig(), tmp_path)
    points = np.concatenate([read_tile(session.tiles, tile, VOXEL_M) for tile in tiles(session.tiles)])
    gone = np.concatenate([found[tile] for tile in tiles(session.tiles)])
    someone = points["intensity"] == 100
    assert someone.sum() > 300
    assert gone[someone].mean() > 0.6
    assert gone[~someone].mean() < 0.002
    stems = np.linalg.norm(points["xyz"][:, None, :2] - STEMS, axis=2).min(axis=1) < 0.2
    assert not gone[stems & ~someone].any()


def test_a_ray_passes_the_cells_that_lie_on_it_up_to_its_end():
    random, shape, low, cell = np.random.default_rng(1), (9, 8, 7), np.array([-1.0, -1.2, -0.5]), 0.3
    begins, ends = random.uniform(-4.0, 4.0, (60, 3)), random.uniform(-4.0, 4.0, (60, 3))
    spans = np.tile(np.array([0, 0], np.int32), (9 * 8 * 7, 1))
    for begin, end in zip(begins, ends, strict=True):
        seen = np.zeros((len(spans), 3), np.int32)
        look_through(begin[None], end[None], np.array([900], np.int32), low, cell, shape, spans, 500, seen)
        length = np.linalg.norm(end - begin)
        steps = begin + np.arange(0.0, max(length - SHORT_M, 0.0), 1e-3)[:, None] * (end - begin) / length
        index = np.floor((steps - low) / cell).astype(int)
        index = index[((index >= 0) & (index < shape)).all(axis=1)]
        passed = np.zeros(shape, bool)
        passed[tuple(index.T)] = True
        wrong = np.flatnonzero(passed.ravel() != (seen[:, 0] > 0))
        assert len(wrong) <= 1  # a corner that is cut by less than a step
    assert (seen[:, 2] == 0).all()
