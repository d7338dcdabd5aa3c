"""`mapforest evaluate map` prints what was measured, and refuses what cannot be."""

from __future__ import annotations

import json

import numpy as np
import pytest

from edge.cli import exit_codes
from edge.cli.main import main


@pytest.fixture
def cloud(tmp_path):
    rng = np.random.default_rng(1)
    rows = np.column_stack([rng.uniform(0.0, 6.0, (4000, 2)), rng.normal(0.0, 0.01, 4000)])
    head = (
        "ply\nformat ascii 1.0\nelement vertex 4000\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
    path = tmp_path / "map.ply"
    path.write_text(head + "\n".join(" ".join(f"{value:.4f}" for value in row) for row in rows) + "\n")
    return path


def test_a_map_is_told_for_people_and_for_programs(cloud, tmp_path, capsys):
    control = tmp_path / "points.csv"
    control.write_text("name,x,y,z\nK1,3,3,-0.05\n")
    assert (
        main(["evaluate", "map", str(cloud), "--control", str(control), "--reference", str(cloud)]) == exit_codes.GOOD
    )
    told = capsys.readouterr().out
    for words in ("map.ply: 4,000 points", "the points carry no time", "no target that reflects was seen", "+0.05"):
        assert words in told
    assert main(["evaluate", "map", str(cloud), "--json"]) == exit_codes.GOOD
    found = json.loads(capsys.readouterr().out)
    assert found["sharpness"]["surface_m"] == pytest.approx(0.0115, rel=0.1)
    assert found["overlap"]["median_m"] is None
    assert found["control"] is None


def test_what_cannot_be_measured_is_refused(cloud, tmp_path, capsys):
    for arguments, code, words in [
        ([str(cloud), "--radius", "5"], exit_codes.USAGE, "between 0.05 and 2 metres"),
        ([str(cloud), "--gap", "0"], exit_codes.USAGE, "more than 0 seconds"),
        ([str(cloud), "--truth", str(cloud)], exit_codes.USAGE, "--reference or --control"),
        ([str(tmp_path / "none.laz")], exit_codes.FAILED, "there is no such file"),
        ([str(tmp_path)], exit_codes.FAILED, "expected a session, or a map"),
        ([str(cloud), "--control", str(tmp_path / "none.csv")], exit_codes.FAILED, "cannot be read"),
    ]:
        assert main(["evaluate", "map", *arguments]) == code
        assert words in capsys.readouterr().err
