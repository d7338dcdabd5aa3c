"""Coverage: each image counts once a cell, evidence is the largest over the height, and nothing is not zero."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.products.coverage import CoverageGrid


def oracle(views, cell_m):
    """By a dictionary, point by point."""
    found = {}
    for points, sigma in views:
        for cell in {(int(np.floor(x / cell_m)), int(np.floor(y / cell_m))) for x, y, _ in points}:
            count, best = found.get(cell, (0, np.inf))
            found[cell] = (count + 1, min(best, sigma))
    return found


def test_each_image_counts_once_a_cell_wherever_it_lies():
    random = np.random.default_rng(3)
    views = [(random.normal(0, 40, (500, 3)), 0.1 * k) for k in range(1, 6)]
    grid = CoverageGrid(2.0)
    for points, sigma in views:
        grid.see(points, sigma)
    truth = oracle(views, 2.0)
    places = (np.array(list(truth)) + 0.5) * 2.0
    seen = grid.sample(places)
    assert seen.views.tolist() == [count for count, _ in truth.values()]
    np.testing.assert_allclose(seen.sigma_m, [best for _, best in truth.values()], rtol=1e-6)
    assert grid.area_m2 == 4.0 * len(truth)
    cells = np.array(list(truth)) * 2.0
    assert grid.bounds_m() == (*cells.min(axis=0), *(cells.max(axis=0) + 2.0))
    assert sum(int(np.count_nonzero(cells.views)) for _, cells in grid.blocks()) == len(truth)


def test_a_block_says_where_its_cells_are():
    grid = CoverageGrid(0.5)
    grid.see(np.array([[-40.2, 70.3, 5.0]]), 0.2)
    ((west, south), cells), *others = grid.blocks()
    (row,), (column,) = np.nonzero(cells.views)
    assert not others
    assert west + column * 0.5 == -40.5
    assert south + row * 0.5 == 70.0


def test_evidence_is_the_largest_over_the_height_and_each_point_has_its_own_sigma():
    grid = CoverageGrid(1.0)
    points = np.array([[0.2, 0.2, 0.0], [0.3, 0.9, 9.0], [5.5, 0.5, 1.0]])
    grid.see(points, np.array([0.4, 0.3, 0.9]))
    grid.weigh(points[:2], np.array([-3.0, 2.0]))
    found = grid.sample(np.array([[0.5, 0.5], [5.1, 0.1], [50.0, 50.0]]))
    assert found.views.tolist() == [1, 1, 0]
    assert found.probability[0] == pytest.approx(1 / (1 + np.exp(-2.0)))
    assert found.probability[1] == 0.0
    assert np.isnan(found.probability[2])
    np.testing.assert_allclose(found.sigma_m, [0.3, 0.9, np.nan])


def test_a_grid_comes_back_from_the_disk(tmp_path):
    grid = CoverageGrid(0.25)
    points = np.random.default_rng(1).uniform(-100, 100, (300, 3))
    grid.see(points, 0.2)
    grid.weigh(points, np.linspace(-5, 5, 300))
    grid.save(tmp_path / "seen.npz")
    back = CoverageGrid.load(tmp_path / "seen.npz")
    before, after = grid.sample(points[:, :2]), back.sample(points[:, :2])
    np.testing.assert_array_equal(before.views, after.views)
    np.testing.assert_array_equal(before.probability, after.probability)
    back.see(points, 0.1)
    assert back.sample(points[:1, :2]).views[0] == before.views[0] + 1


def test_nothing_seen_is_nothing():
    grid = CoverageGrid()
    grid.see(np.empty((0, 3)), 0.1)
    grid.weigh(np.empty((0, 3)), np.empty(0))
    assert (grid.bounds_m(), grid.area_m2, list(grid.blocks())) == (None, 0.0, [])
    assert grid.sample(np.zeros((1, 2))).views.tolist() == [0]
    assert len(grid.sample(np.empty((0, 2))).views) == 0
