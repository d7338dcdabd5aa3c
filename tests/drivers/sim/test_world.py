"""A configuration is a world; the truth on disk is the truth."""

import csv
import json

import numpy as np
import pytest

from drivers.errors import SimulationError
from drivers.sim.scenarios import SCENARIOS, WorldConfig, scenario
from drivers.sim.truth import write_truth
from drivers.sim.world import build

S = 1_000_000_000


def test_demo_is_a_minute_with_tree_of_heaven_beside_the_path():
    world = build(scenario("demo"))
    assert 55.0 < world.trajectory.duration_ns / S < 65.0
    ailanthus = world.trees.position_m[world.trees.species == 4, :2]
    away = np.linalg.norm(ailanthus[:, None] - world.route.points_m[None], axis=2).min(axis=1)
    assert (away < 6.0).sum() >= 6


LONG = {"loop_800", "loop_1200", "out_and_back_1200"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in SCENARIOS]
)
def test_every_scenario_has_a_walk_clear_of_stems(name):
    world = build(scenario(name))
    at = world.trajectory.poses(np.arange(0, world.trajectory.duration_ns, 400_000_000))[0]
    xy, radius = world.trees.position_m[:, :2], 0.5 * world.trees.dbh_m
    for place in at[:, :2]:
        assert (np.linalg.norm(xy - place, axis=1) - radius).min() > 0.35


def test_parts_are_built_only_when_asked_for():
    world = build(scenario("demo"))
    world.trajectory.position(3 * S)
    assert "scene" not in vars(world)
    assert "trees" not in vars(world)


def test_canopy_is_open_on_the_meadow_and_closed_in_the_thicket():
    meadow, thicket = build(scenario("meadow_edge")), build(scenario("thicket"))
    cover = [meadow.antenna.canopy(t * S) for t in range(0, 140, 5)]
    assert min(cover) < 0.3
    assert max(cover) > 0.6
    assert min(thicket.antenna.canopy(t * S) for t in range(0, 100, 5)) > 0.6


def test_unknown_scenario_is_refused():
    with pytest.raises(SimulationError, match="demo"):
        scenario("desert")


def test_truth_on_disk_is_the_trajectory_and_the_inventory(tmp_path):
    world = build(WorldConfig(length_m=30.0, seed=3))
    write_truth(world, tmp_path)
    poses = np.loadtxt(tmp_path / "poses.tum")
    assert poses[0, 0] == 0.0
    np.testing.assert_allclose(np.diff(poses[:, 0]), 0.01, atol=1e-9)
    np.testing.assert_allclose(poses[1500, 1:4], world.trajectory.position(15 * S), atol=1e-6)
    with (tmp_path / "stems.csv").open(encoding="utf-8") as file:
        stems = list(csv.DictReader(file))
    assert len(stems) == len(world.trees)
    assert float(stems[4]["dbh_m"]) == pytest.approx(world.trees.dbh_m[4], abs=1e-4)
    assert {"Ailanthus altissima", "Quercus rubra"} <= {row["scientific_name"] for row in stems}
    about = json.loads((tmp_path / "world.json").read_text(encoding="utf-8"))
    assert about["seed"] == 3
    assert about["datum"]["latitude_deg"] == world.config.datum.latitude_deg
