from dataclasses import replace

import numpy as np
import pytest

from drivers.sim.boxes import Annotation
from drivers.sim.scenarios import scenario
from drivers.sim.seen import from_way_m, seen_s
from drivers.sim.species import Species
from drivers.sim.world import build

DURING_NS = (8 * 10**9, 9 * 10**9)


@pytest.fixture(scope="module")
def world():
    return build(replace(scenario("open_trail", 3), length_m=12.0))


def test_who_stands_before_the_camera_is_seen_and_who_stands_elsewhere_is_not(world):
    rule = Annotation(within_m=12.0)
    seen = seen_s(world, list(Species), rule, DURING_NS)
    away = from_way_m(world, world.trees.position_m[:, :2])
    assert 0.0 < seen.max() <= 1.3
    assert seen[away > rule.within_m].max() == 0.0
    assert (seen > 0.5).sum() > 3
    only = seen_s(world, [Species.TREE_OF_HEAVEN], rule, DURING_NS)
    np.testing.assert_array_equal(only, np.where(world.trees.species == Species.TREE_OF_HEAVEN, seen, 0.0))


def test_the_distance_from_the_way_is_the_nearest(world):
    position, _ = world.trajectory.poses([3 * 10**9])
    assert from_way_m(world, position[:, :2] + 1e-3)[0] < 0.2
    assert from_way_m(world, np.array([[1000.0, 0.0]]))[0] == pytest.approx(1000.0, rel=0.05)
