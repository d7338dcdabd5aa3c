"""Mapped trees are compared with those that the emulated camera saw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.sim.species import Species
from edge.cli.main import main
from edge.errors import FormatError
from edge.process.product_facts import FindingFacts
from edge.process.trees_against_truth import compare_trees
from edge.process.trees_file import TREES, write_trees
from tests.edge.off_truth import EPOCH_NS, OFFSET_NS, in_map, short_trail, write_facts, write_products, write_true
from tests.pipeline.evaluation.test_trees import tree

OFF_M = np.array([0.5, -0.2, 0.1])
"""Of the estimate from the truth, in the world."""
FOUND = FindingFacts("toh", "abc", False, 10, 1, 1, 1.0, 1.0, "")


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    return write_true(tmp_path_factory.mktemp("truth"))


@pytest.fixture
def session(tmp_path):
    folder = tmp_path / "products"
    (folder / "work" / "grounding").mkdir(parents=True)
    write_products(folder, np.arange(18 * 10**9, 20 * 10**9, 10**8), OFF_M, FOUND)
    return folder


def mapped(session, places_m):
    middle = EPOCH_NS + OFFSET_NS + 19 * 10**9
    trees = [replace(tree(k, 0.0), position_m=p, first_ns=middle, last_ns=middle) for k, p in enumerate(places_m)]
    write_trees(session / "work" / "grounding" / TREES, trees)


def test_errors_are_those_on_the_earth_and_beside_the_way(truth, session, capsys):
    trees = short_trail().trees
    places = trees.position_m[trees.species == Species.TREE_OF_HEAVEN]
    mapped(session, [])
    asked = compare_trees(session, truth, 0.5).on_the_earth
    assert 0 < asked.true <= len(places)
    assert asked.found == 0
    mapped(session, in_map(places + OFF_M))
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
    write_facts(session)
    with pytest.raises(FormatError, match="no detector looked"):
        compare_trees(session, truth, 0.5)
