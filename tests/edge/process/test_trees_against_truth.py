"""Mapped trees are compared with those that the emulated camera saw."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from drivers.sim.scenarios import scenario
from drivers.sim.species import Species
from drivers.sim.truth import write_epoch, write_truth
from drivers.sim.world import build
from edge.cli.main import main
from edge.errors import FormatError
from edge.process.product_facts import FindingFacts, ProductFacts
from edge.process.trees_against_truth import compare_trees
from edge.process.trees_file import TREES, write_trees
from pipeline.gnss.geodesy import Datum
from pipeline.products.tum import write_tum
from tests.pipeline.evaluation.test_trees import tree

EPOCH_NS, OFFSET_NS = 5_000_000_000, 1_790_000_000_000_000_000
OFF_M = np.array([0.5, -0.2, 0.1])
"""Of the estimate from the truth, in the world."""
FOUND = FindingFacts("toh", "abc", False, 10, 1, 1, 1.0, 1.0, "")


@pytest.fixture(scope="module")
def world():
    return build(replace(scenario("open_trail", 4), length_m=16.0))


@pytest.fixture(scope="module")
def truth(world, tmp_path_factory):
    folder = tmp_path_factory.mktemp("truth")
    write_truth(world, folder)
    write_epoch(folder, EPOCH_NS)
    return folder


@pytest.fixture
def session(world, tmp_path):
    """Its datum is not the world's."""
    folder = tmp_path / "products"
    (folder / "work" / "grounding").mkdir(parents=True)
    t_ns = np.arange(18 * 10**9, 21 * 10**9, 10**8)
    positions, rotations = world.trajectory.poses(t_ns)
    write_tum(folder / "trajectory.tum", t_ns + EPOCH_NS + OFFSET_NS, in_map(world, positions + OFF_M), rotations)
    facts = ProductFacts("walk", "map", "", datum=HERE, host_offset_ns=OFFSET_NS, findings=FOUND)
    (folder / "products.json").write_bytes(msgspec.json.encode(facts))
    return folder


HERE = (40.0575, -75.2180, 60.0)


def in_map(world, places_m):
    datum, here = world.config.datum, Datum(*HERE)
    there = Datum(datum.latitude_deg, datum.longitude_deg, datum.height_m)
    return np.array([here.enu(*there.geodetic(place)) for place in places_m])


def mapped(session, places_m):
    middle = EPOCH_NS + OFFSET_NS + 19 * 10**9
    trees = [replace(tree(k, 0.0), position_m=p, first_ns=middle, last_ns=middle) for k, p in enumerate(places_m)]
    write_trees(session / "work" / "grounding" / TREES, trees)


def test_errors_are_those_on_the_earth_and_beside_the_way(world, truth, session, capsys):
    places = world.trees.position_m[world.trees.species == Species.TREE_OF_HEAVEN]
    mapped(session, [])
    asked = compare_trees(session, truth, 0.5).on_the_earth
    assert 0 < asked.true <= len(places)
    assert asked.found == 0
    mapped(session, in_map(world, places + OFF_M))
    found = compare_trees(session, truth, 0.5)
    assert found.on_the_earth.recall == found.on_the_earth.precision == 1.0
    assert found.on_the_earth.error_median_m == pytest.approx(np.hypot(0.5, 0.2), abs=1e-3)
    assert found.beside_the_way.error_worst_m < 0.002
    assert main(["evaluate", "trees", str(session), "--truth", str(truth)]) == 0
    out = capsys.readouterr().out
    assert "100%" in out
    assert "0.54" in out
    assert max(map(len, out.splitlines())) <= 80


def test_what_cannot_be_compared_is_told(truth, session):
    with pytest.raises(FormatError, match="without --clean"):
        compare_trees(session, truth, 0.5)
    facts = ProductFacts("walk", "map", "", datum=HERE, host_offset_ns=OFFSET_NS)
    (session / "products.json").write_bytes(msgspec.json.encode(facts))
    with pytest.raises(FormatError, match="no detector looked"):
        compare_trees(session, truth, 0.5)
