import numpy as np
import pytest

from pipeline.grounding.ground import Ground
from pipeline.grounding.ground_kernels import lowest
from pipeline.grounding.stems import find_stems
from pipeline.grounding.surroundings import Neighbourhood, Surroundings
from tests.pipeline.grounding.grove import Grove, Trunk

RANDOM = np.random.default_rng(4)


def slope(xy, share=0.3):
    return share * xy[:, 0] - 0.1 * xy[:, 1]


def test_the_ground_under_a_slope_with_brush_is_the_slope():
    xy = RANDOM.uniform(-12, 12, (30_000, 2))
    brush = RANDOM.uniform(-12, 12, (9000, 2))
    points = np.concatenate(
        [
            np.column_stack([xy, slope(xy) + RANDOM.normal(0, 0.02, len(xy))]),
            np.column_stack([brush, slope(brush) + RANDOM.uniform(0.1, 1.5, len(brush))]),
            np.array([[0.0, 0.0, -6.0], [3.0, 3.0, -4.0]]),  # stray
        ]
    )
    asked = RANDOM.uniform(-10, 10, (500, 2))
    error = Ground.under(points).at(asked) - slope(asked)
    assert abs(np.median(error)) < 0.25
    assert np.abs(error).max() < 0.6


def test_the_lowest_of_a_cell_are_those_that_sorting_finds():
    points = RANDOM.uniform([-3, 5, -1], [2, 9, 4], (400, 3))
    found = lowest(points, np.array([-3.0, 5.0]), 1.0, 5, 4, 2)
    for i in range(5):
        for j in range(4):
            inside = (np.floor(points[:, 0]) + 3 == i) & (np.floor(points[:, 1]) - 5 == j)
            assert found[i, j] == np.sort(points[inside, 2])[2]
    few = lowest(points[:2] * 0 + [[-2.5, 5.5, 3.0], [-2.5, 5.5, 1.0]], np.array([-3.0, 5.0]), 1.0, 1, 2, 2)
    np.testing.assert_array_equal(few, [[3.0, np.nan]])


def test_where_only_a_crown_was_seen_the_ground_is_that_of_the_neighbours():
    xy = RANDOM.uniform(-12, 12, (30_000, 2))
    flat = np.column_stack([xy, np.zeros(len(xy))])
    flat = flat[np.abs(xy).max(axis=1) > 2.0]
    crown = np.column_stack([RANDOM.uniform(-2, 2, (3000, 2)), RANDOM.uniform(4, 7, 3000)])
    assert abs(Ground.under(np.concatenate([flat, crown])).at(np.zeros((1, 2)))[0]) < 0.3


def test_stems_are_found_and_brush_is_not():
    grove = Grove([Trunk(2, 4), Trunk(5, 6, radius=0.2), Trunk(6.2, 6.5, radius=0.05)])
    brush = np.column_stack([RANDOM.uniform(-5, 0, (4000, 2)), RANDOM.uniform(0, 1.2, 4000)])
    around = Surroundings.of(np.zeros(3), np.concatenate([grove.points, brush]))
    places = np.array(sorted(stem.place_m.tolist() for stem in around.stems))
    np.testing.assert_allclose(places, [[2, 4], [5, 6], [6.2, 6.5]], atol=0.1)


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])])
def test_next_to_nothing_has_no_stems(points):
    assert find_stems(points, points[:, 2]) == []


def test_the_map_is_fetched_again_only_when_the_camera_has_moved_on():
    asked = []

    class Source:
        def around(self, place_m, radius_m):
            asked.append(place_m)
            return np.empty((0, 3)) if place_m[0] > 50 else np.random.default_rng(1).uniform(-5, 5, (100, 3))

    near = Neighbourhood(Source(), 18.0)
    first = near.at(np.zeros(3))
    assert near.at(np.array([3.0, 0, 0])) is first
    assert near.at(np.array([6.0, 0, 0])) is not first
    assert len(asked) == 2
    assert near.at(np.array([90.0, 0, 0])) is None
