"""Measured stems of a session are compared with those of the simulated forest."""

import csv
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from drivers.sim.scenarios import scenario
from drivers.sim.truth import write_epoch, write_truth
from drivers.sim.world import build
from edge.errors import FormatError
from edge.inventory.against_truth import read_diameters
from edge.process.product_facts import ProductFacts
from pipeline.evaluation.diameters import diameter_errors
from pipeline.gnss.geodesy import Datum
from pipeline.products.earth import Site
from pipeline.products.tum import write_tum

EPOCH_NS, OFFSET_NS = 5_000_000_000, 1_790_000_000_000_000_000
HERE = (40.0575, -75.2180, 60.0)
OFF_M = np.array([2.5, -1.2, 0.1])
"""Of the estimate from the truth, in the world: GNSS under trees."""


@pytest.fixture(scope="module")
def world():
    return build(replace(scenario("open_trail", 4), length_m=30.0))


@pytest.fixture(scope="module")
def truth(world, tmp_path_factory):
    folder = tmp_path_factory.mktemp("truth")
    write_truth(world, folder)
    write_epoch(folder, EPOCH_NS)
    return folder


def products(world, folder, places_m, dbh_m):
    """A session whose datum is not the world's, with stems (n, 3) and diameters in it."""
    datum, here = world.config.datum, Datum(*HERE)
    there = Datum(datum.latitude_deg, datum.longitude_deg, datum.height_m)

    def in_map(at):
        return (at + OFF_M) @ (here.turn.T @ there.turn).T + here.turn.T @ (there.origin_m - here.origin_m)

    (folder / "inventory").mkdir(parents=True)
    t_ns = np.arange(0, world.trajectory.duration_ns, 10**8)
    positions, rotations = world.trajectory.poses(t_ns)
    write_tum(folder / "trajectory.tum", t_ns + EPOCH_NS + OFFSET_NS, in_map(positions), rotations)
    facts = ProductFacts("walk", "map", "", datum=HERE, host_offset_ns=OFFSET_NS)
    (folder / "products.json").write_bytes(msgspec.json.encode(facts))
    with (folder / "inventory" / "trees.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["tree_id", "x", "y", "dbh_cm", "dbh_sd_cm", "status"])
        for k, (x, y, _) in enumerate(Site(HERE).utm(in_map(places_m)).tolist()):
            writer.writerow([k + 1, x, y, 100 * dbh_m[k], 1.0, "unverified"])
    return folder


def test_stems_from_10_cm_beside_the_way_should_be_found_and_the_error_of_the_way_is_no_theirs(world, truth, tmp_path):
    trees = world.trees
    positions, _ = world.trajectory.poses(np.arange(0, world.trajectory.duration_ns, 10**8))
    away = np.linalg.norm(trees.position_m[:, None, :2] - positions[None, :, :2], axis=2).min(axis=1)
    near = np.flatnonzero((away < 14.0) & (trees.dbh_m > 0.10))
    made_up = positions[40] + (0.0, 3.0, 0.0)
    measured = np.vstack([trees.position_m[near[1:]], made_up])
    folder = products(world, tmp_path / "products", measured, np.append(trees.dbh_m[near[1:]] + 0.01, 0.3))
    found = diameter_errors(read_diameters(folder, truth))
    wanted = (away <= 15.0) & (trees.dbh_m >= 0.10)
    assert (found.true, found.found) == (wanted.sum(), len(near) - 1)
    assert (found.measured, found.made_up) == (len(near), 1)
    assert found.bias_m == pytest.approx(0.01, abs=1e-3)


def test_what_was_not_measured_is_told(world, truth, tmp_path):
    with pytest.raises(FormatError, match="run it on"):
        read_diameters(tmp_path, truth)
