from dataclasses import replace

import numpy as np

from pipeline.grounding.placed import to_map
from pipeline.grounding.sources import RollingPoints, TilePoints
from pipeline.products.tiles import TileStore
from pipeline.products.track import Placement
from tests.pipeline.evaluation.test_trees import tree


def test_the_points_around_come_from_all_tiles(tmp_path):
    random = np.random.default_rng(8)
    cloud = np.column_stack([random.uniform(-60, 60, (20_000, 3)) * [1, 1, 0.05], np.zeros(20_000)]).astype(np.float32)
    store = TileStore(tmp_path, 16.0, 0.01)
    store.add(cloud, 0)
    store.close()
    source = TilePoints(tmp_path, 16.0, 0.01)
    for place in np.array([[3.0, -4.0, 0.0], [50.0, 50.0, 1.0], [-31.0, 16.0, 0.0]]):
        found = source.around(place, 20.0)
        within = np.linalg.norm(cloud[:, :3] - place, axis=1) < 20.0
        assert {tuple(p) for p in found.tolist()} == {tuple(p) for p in cloud[within, :3].astype(float).tolist()}
    assert source.around(np.array([500.0, 0.0, 0.0]), 20.0).shape == (0, 3)


def test_only_the_last_sweeps_are_held():
    rolling = RollingPoints(sweeps=3, a_sweep=10)
    assert rolling.around(np.zeros(3), 5.0).shape == (0, 3)
    for k in range(5):
        rolling.add(np.full((100, 3), 0.1 * k, np.float32))
    found = rolling.around(np.zeros(3), 50.0)
    assert len(found) == 30
    np.testing.assert_allclose(np.unique(found), [0.2, 0.3, 0.4], atol=1e-6)


def test_a_tree_goes_to_the_map_with_the_placement_of_its_time():
    stamps = np.array([0, 100, 200])
    cov = np.tile(np.diag([0.04, 0.09, 0.16, 0, 0, 0]), (3, 1, 1))
    placement = Placement.upright(
        (40.0, -75.0, 0.0), np.array([[0, 0, 0], [10.0, 0, 1], [99, 99, 99]]), np.array([0, np.pi / 2, 1]), cov
    )
    one = tree(1, 2.0, 1.0)
    one.covariance[0, 0] = 1.0
    placed = to_map([replace(one, first_ns=20, last_ns=180)], placement, stamps)[0]
    assert placed.frame == "map"
    np.testing.assert_allclose(placed.position_m, [9.0, 2.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(np.diag(placed.covariance), [0.09 + 0.04, 1.0 + 0.09, 0.04 + 0.16])
