"""Sessions of one site are refined into one folder; those that do not meet are told of by name."""

from __future__ import annotations

import json
import shutil

import pytest

pytest.importorskip("gtsam", reason="GTSAM has no wheel for this Python")
pytest.importorskip("small_gicp", reason="small_gicp is not installed")

from edge.config import Config
from edge.errors import EdgeError, FormatError
from edge.process.process import Task
from edge.process.together import refine_together
from tests.edge.process.test_process import fakes
from tests.edge.process.test_refine import Striding


@pytest.fixture
def two(recording):
    other = recording.with_name("later.mcap")
    shutil.copyfile(recording, other)
    return [Task([recording]), Task([other])]


def test_sessions_that_nothing_joins_are_refined_alone_and_a_second_run_does_nothing(two):
    done = refine_together(two, Config(), load=fakes(odometry=Striding))
    assert done.folder == two[0].targets[0].parent / "walk_and_1_more_refined"
    assert [group.sessions for group in done.groups] == [("walk",), ("later",)]
    for name in ("walk", "later"):
        made = {path.name for path in (done.folder / name).iterdir()}
        assert made >= {"refinement.html", "closures.csv", "trajectory_local.tum", "map_local.laz", "products.json"}
        told = json.loads((done.folder / name / "refinement.json").read_text())
        assert f"{name} was refined alone" in told["notes"][0]
    assert refine_together(two, Config(), load=None).redone == ()


def test_a_session_named_twice_or_unknown_is_refused(two, tmp_path):
    with pytest.raises(EdgeError, match="2 sessions are called walk"):
        refine_together([two[0], two[0]], Config(), load=fakes(odometry=Striding))
    asked = tmp_path / "constraints.toml"
    asked.write_text('[[forbid]]\na = "walk"\nb = "earlier"\na_s = 0.1\nb_s = 0.2\n')
    with pytest.raises(EdgeError, match="of session 'earlier': there are walk, later"):
        refine_together(two, Config(), constraints=asked, load=fakes(odometry=Striding))
    asked.write_text("[[forbid]]\na_s = 0.1\n")
    with pytest.raises(FormatError, match="missing required field"):
        refine_together(two, Config(), constraints=asked, load=fakes(odometry=Striding))
