"""Places are known again by their stems, wherever they are said to be; what is alike in many ways is said to be."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.refinement.agreement import agree
from pipeline.refinement.config import RecognitionConfig
from pipeline.refinement.recognition import recognise
from pipeline.refinement.stems import NEIGHBOURS, place, triangles
from tests.pipeline.refinement.test_registration import WILD, moved, seen_from, stand

ROWS = np.array([(x, y) for x in np.arange(-16.0, 17.0, 3.0) for y in np.arange(-16.0, 17.0, 2.0)])
OTHER = np.random.default_rng(6).uniform(-16.0, 16.0, (40, 2))


def known(*clouds, **settings):
    """Proposals of the last cloud, which may be any of the others."""
    allowed = ~np.eye(len(clouds), dtype=bool)
    places = [place(points.astype(np.float32)) for points in clouds]
    return list(recognise(places, allowed, RecognitionConfig(**settings)))[-1]


def test_a_stand_is_known_among_others_from_any_side():
    true = moved(130.0, -42.0, 2.5)
    (found,) = known(stand(OTHER, 3), stand(WILD, 1), seen_from(true, stand(WILD, 2)))
    assert (found.a, found.b, found.sure) == (1, 2, True)
    np.testing.assert_allclose(found.pose()[:2, :2], true[:2, :2], atol=0.02)
    middle = np.linalg.inv(true) @ [0.0, 0.0, 0.0, 1.0]
    assert np.linalg.norm((found.pose() @ middle)[:3]) < 0.15
    assert found.met > 0.7 * found.asked


def test_rows_fit_in_many_ways_and_another_stand_in_none():
    level = [stand(ROWS, seed) * [1.0, 1.0, 1.0] for seed in (1, 2)]
    assert not any(found.sure for found in known(*level))
    assert not known(stand(WILD, 1), stand(OTHER, 2))


def test_a_place_that_may_not_be_meant_is_not_proposed():
    places = [place(stand(WILD, seed).astype(np.float32)) for seed in (1, 2)]
    assert not any(recognise(places, np.zeros((2, 2), bool), RecognitionConfig()))


def test_triangles_are_the_same_from_anywhere_but_in_a_mirror():
    turned = WILD @ moved(0.0, 0.0, 1.0)[:2, :2].T + [5.0, 7.0]
    here, there = triangles(WILD), triangles(turned)
    np.testing.assert_allclose(here.sides_m, there.sides_m, atol=1e-9)
    np.testing.assert_array_equal(here.corners, there.corners)
    np.testing.assert_array_equal(here.left, there.left)
    np.testing.assert_array_equal(triangles(WILD * [1.0, -1.0]).left, ~here.left)
    across = np.linalg.norm(WILD[here.corners[:, 0]] - WILD[here.corners[:, 1]], axis=1)
    np.testing.assert_allclose(across, here.sides_m[:, 2])
    assert not len(triangles(WILD[:NEIGHBOURS]).sides_m)


@pytest.mark.parametrize(("off_m", "way_m", "same"), [(0.4, 5.0, True), (1.2, 5.0, False), (1.2, 30.0, True)])
def test_places_agree_as_far_as_the_odometry_between_them_tells(off_m, way_m, same):
    at = np.array([100.0, 0.0, 0.0])
    one, other = moved(3.0, 4.0, 0.5), moved(3.0, 4.0, 0.5) @ moved(off_m, 0.0, 0.0)
    assert agree(one, other, at, way_m) == same
    about = moved(100.0, 0.0, 0.0) @ moved(0.0, 0.0, 0.2) @ moved(-100.0, 0.0, 0.0)
    assert not agree(one, one @ about, at, way_m)
