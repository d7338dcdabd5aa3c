"""Surveyed points: what is read, and what is found at them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.evaluation.control import ControlPoint, Surroundings, control_errors, read_control, residual
from pipeline.evaluation.errors import ControlError
from pipeline.inventory.terrain import Terrain

SLOPE = 0.2
LEVEL_M = 100.0


def surroundings(seed=1, *, target=(), rough_m=0.01):
    """A slope that rises to the east with grass on it, and perhaps a target at (x, y)."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-2.0, 2.0, (3000, 2))
    xyz = np.column_stack([xy, LEVEL_M + SLOPE * xy[:, 0] + rng.normal(0.0, rough_m, len(xy))])
    xyz[::5, 2] += rng.uniform(0.05, 0.18, len(xyz[::5]))  # grass: one in five
    marked = (
        np.column_stack([np.array(target) + rng.uniform(-0.1, 0.1, (40, 2)), np.full(40, LEVEL_M)]) if target else None
    )
    every = xyz if marked is None else np.vstack([xyz, marked])
    middles = -3.0 + 0.5 * (np.arange(12) + 0.5)
    terrain = Terrain(
        np.array([-3.0, -3.0]), 0.5, LEVEL_M + SLOPE * np.repeat(middles[:, None], 12, 1), np.ones((12, 12), bool)
    )
    return Surroundings(every, np.arange(len(every)) >= len(xyz), terrain)


def test_the_residual_is_that_of_the_ground_without_what_grows_on_it():
    at = np.array([0.5, 0.2, LEVEL_M + SLOPE * 0.5 - 0.07])
    found = residual(ControlPoint("A", *at), at, surroundings())
    assert found.up_m == pytest.approx(0.07, abs=0.01)
    assert (found.east_m, found.north_m) == (None, None)
    assert found.points > 50


def test_a_target_that_reflects_tells_where_the_point_is_in_plan():
    at = np.array([0.0, 0.0, LEVEL_M])
    found = residual(ControlPoint("A", *at), at, surroundings(target=(0.12, -0.05)))
    assert (found.east_m, found.north_m) == (pytest.approx(0.12, abs=0.02), pytest.approx(-0.05, abs=0.02))
    wide = surroundings(target=(0.0, 0.0))
    wide.xyz[wide.reflector, 0] *= 8.0
    assert residual(ControlPoint("A", *at), at, wide).east_m is None


def test_where_there_is_no_ground_nothing_is_said():
    at = np.array([30.0, 0.0, LEVEL_M])
    found = residual(ControlPoint("A", *at), at, surroundings())
    assert (found.up_m, found.points) == (None, 0)
    together = control_errors(
        [found, residual(ControlPoint("B", 0, 0, LEVEL_M), np.array([0, 0, LEVEL_M]), surroundings())]
    )
    assert together.up_rmse_m == pytest.approx(abs(together.up_bias_m))
    assert np.isnan(together.horizontal_rmse_m)
    assert np.isnan(control_errors([found]).up_rmse_m)


def test_a_list_is_read_and_a_bad_line_is_named(tmp_path):
    path = tmp_path / "points.csv"
    path.write_text("name,x,y,z\nA,1.5,2,3\nB,4,5,6\n")
    assert read_control(path) == [ControlPoint("A", 1.5, 2, 3), ControlPoint("B", 4, 5, 6)]
    for text, words in [
        ("name,x,y\nA,1,2\n", "the first line has no z"),
        ("name,x,y,z\nA,1,2,3\nB,1,two,3\n", "line 3: x, y and z are no numbers"),
        ("name,x,y,z\nA,1,2\n", "line 2: x, y and z are no numbers"),
        ("name,x,y,z\nA,1,2,nan\n", "line 2: x, y and z have to be finite"),
        ("name,x,y,z\n", "has no points"),
    ]:
        path.write_text(text)
        with pytest.raises(ControlError, match=words):
            read_control(path)
    with pytest.raises(ControlError, match="cannot be read"):
        read_control(tmp_path / "nothing.csv")
