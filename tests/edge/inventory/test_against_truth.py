"""Measured stems of a session are compared with those of the simulated forest."""

import csv

import numpy as np
import pytest

from edge.errors import FormatError
from edge.inventory.against_truth import read_diameters
from pipeline.evaluation.diameters import diameter_errors
from pipeline.products.earth import Site
from tests.edge.off_truth import HERE, in_map, short_trail, write_products, write_true

OFF_M = np.array([2.5, -1.2, 0.1])
"""Of the estimate from the truth, in the world: GNSS under trees."""


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    return write_true(tmp_path_factory.mktemp("truth"))


def products(folder, t_ns, places_m, dbh_m):
    """A session with stems (n, 3) and diameters in it."""
    (folder / "inventory").mkdir(parents=True)
    write_products(folder, t_ns, OFF_M)
    with (folder / "inventory" / "trees.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["tree_id", "x", "y", "dbh_cm", "dbh_sd_cm", "status"])
        for k, (x, y, _) in enumerate(Site(HERE).utm(in_map(places_m + OFF_M)).tolist()):
            writer.writerow([k + 1, x, y, 100 * dbh_m[k], 1.0, "unverified"])
    return folder


def test_stems_from_10_cm_beside_the_way_should_be_found_and_the_error_of_the_way_is_no_theirs(truth, tmp_path):
    trees, way = short_trail().trees, short_trail().trajectory
    t_ns = np.arange(0, way.duration_ns, 10**8)
    positions, _ = way.poses(t_ns)
    away = np.linalg.norm(trees.position_m[:, None, :2] - positions[None, :, :2], axis=2).min(axis=1)
    near = np.flatnonzero((away < 14.0) & (trees.dbh_m > 0.10))
    made_up = positions[40] + (0.0, 3.0, 0.0)
    measured = np.vstack([trees.position_m[near[1:]], made_up])
    folder = products(tmp_path / "products", t_ns, measured, np.append(trees.dbh_m[near[1:]] + 0.01, 0.3))
    found = diameter_errors(read_diameters(folder, truth))
    wanted = (away <= 15.0) & (trees.dbh_m >= 0.10)
    assert (found.true, found.found) == (wanted.sum(), len(near) - 1)
    assert (found.measured, found.made_up) == (len(near), 1)
    assert found.bias_m == pytest.approx(0.01, abs=1e-3)


def test_what_was_not_measured_is_told(truth, tmp_path):
    with pytest.raises(FormatError, match="run it on"):
        read_diameters(tmp_path, truth)
