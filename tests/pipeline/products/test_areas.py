"""Patches and searched areas have the areas that can be computed by hand or by counting."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from pipeline.products.areas import UNSEEN_CROWN_M, on_the_globe, on_the_grid, patches, searched_area
from pipeline.products.coverage import CoverageGrid
from tests.pipeline.products.stand import SITE, coverage


def test_neighbours_share_a_patch_and_a_lonely_tree_has_its_own():
    at = np.array([[0.0, 0, 0], [8.0, 0, 0], [50.0, 0, 0]])
    pair, alone = patches(at, np.array([4.0, 4.0, np.nan]), gap_m=5.0)
    assert (pair.members, alone.members) == ((0, 1), (2,))
    assert pair.infested_m2 == pytest.approx(2 * np.pi * 4, rel=0.02)
    assert pair.gross_m2 == pytest.approx(np.pi * 4 + 8 * 4, rel=0.02)
    assert pair.percent_cover == pytest.approx(100 * 8 * np.pi / (4 * np.pi + 32), rel=0.01)
    assert alone.gross_m2 == pytest.approx(np.pi * (UNSEEN_CROWN_M / 2) ** 2, rel=0.02)
    assert alone.percent_cover == pytest.approx(100.0)
    assert len(patches(at, np.array([4.0, 4.0, 4.0]), gap_m=3.9)) == 3


def test_crowns_that_overlap_are_counted_once():
    (one,) = patches(np.zeros((2, 3)), np.array([4.0, 4.0]), gap_m=1.0)
    assert one.infested_m2 == pytest.approx(np.pi * 4, rel=0.02)
    assert one.members == (0, 1)


def test_a_row_of_trees_is_followed_and_a_ring_is_filled():
    bend = np.array([[0.0, 0, 0], [6, 0, 0], [12, 0, 0], [12, 6, 0], [12, 12, 0]])
    (row,) = patches(bend, np.full(5, 4.0), gap_m=3.0)
    assert row.gross_m2 < 0.9 * shapely.convex_hull(row.outline).area
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.column_stack([10 * np.cos(angles), 10 * np.sin(angles), np.zeros(12)])
    (filled,) = patches(np.vstack([ring, np.zeros((1, 3))]), np.full(13, 3.0), gap_m=3.0)
    assert len(filled.members) == 13
    assert not filled.outline.interiors
    assert patches(np.empty((0, 3)), np.empty(0), 5.0) == []


def test_the_searched_area_is_what_was_seen():
    found = searched_area(coverage())
    assert found.area == pytest.approx(60 * 40, rel=0.01)
    assert found.bounds == pytest.approx((-10, -25, 50, 15), abs=0.3)


def test_slits_are_closed_and_what_was_not_seen_stays_open():
    grid = CoverageGrid(0.5)
    x, y = (side.ravel() + 0.25 for side in np.meshgrid(np.arange(0, 80, 0.5), np.arange(0, 40, 0.5)))
    hidden = (np.hypot(x - 20, y - 20) < 5) | ((x > 60) & (x < 61.5))
    grid.see(np.column_stack([x, y])[~hidden], 0.1)
    found = searched_area(grid)
    assert found.area == pytest.approx(80 * 40 - np.pi * 25, rel=0.01)
    assert not found.contains(shapely.Point(20, 20))
    assert searched_area(CoverageGrid()).is_empty


def test_polygons_are_moved_to_the_earth_as_points_are():
    square = shapely.box(100.0, 200.0, 110.0, 220.0)
    corners = np.column_stack([np.array(square.exterior.coords), np.zeros(5)])
    np.testing.assert_allclose(on_the_grid(square, SITE).exterior.coords, SITE.utm(corners)[:, :2], atol=1e-6)
    np.testing.assert_allclose(on_the_globe(square, SITE).exterior.coords, SITE.geodetic(corners)[:, :2], atol=1e-12)
    assert on_the_grid(square, SITE).area == pytest.approx(200 * SITE.scale**2, rel=1e-4)
