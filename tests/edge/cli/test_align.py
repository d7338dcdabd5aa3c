"""`mapforest align` and `mapforest evaluate alignment`, as their users call them."""

from __future__ import annotations

import csv
import json

import laspy
import numpy as np
import pytest

from benchmarks.alignment.stands import from_the_air, from_the_ground, grow, write_las
from edge.cli import exit_codes
from edge.cli.main import main
from pipeline.alignment.transform import Transform

OFF = Transform((500_000.0, 5_400_000.0), 1.5, -2.0, 0.8, 4.0)
SEARCH = ["--search", "4", "--turn", "8"]


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    folder = tmp_path_factory.mktemp("maps")
    stand = grow("mixed", 1, side_m=70.0)
    air = write_las(folder / "air.laz", from_the_air(stand, 6.0))
    ground = write_las(folder / "ground.laz", from_the_ground(stand, 16.0, OFF, crowns=True), None)
    return air, ground, stand


def test_the_map_and_its_tables_come_out_in_the_frame_of_the_aerial_map(maps, tmp_path, capsys):
    air, ground, _ = maps
    trees, out = tmp_path / "trees.csv", tmp_path / "out"
    trees.write_text("id,x,y\n7,500003.0,5400001.0\n")
    code = main(["align", str(air), str(ground), "--output", str(out), "--trees", str(trees), "--json", *SEARCH])
    told = json.loads(capsys.readouterr().out)
    assert code == exit_codes.GOOD, told["doubts"]
    merged = laspy.read(out / "merged.laz")
    assert merged.header.parse_crs().to_epsg() == 32633
    from_ground = merged.xyz[np.asarray(merged["source"]) == 2]
    before = laspy.read(ground).xyz
    assert len(from_ground) == len(before)
    np.testing.assert_allclose(from_ground, OFF.apply(before), atol=0.6)
    with (out / "trees_aligned.csv").open() as file:
        row = next(csv.DictReader(file))
    there = OFF.apply(np.array([[500_003.0, 5_400_001.0]]))[0]
    assert row["id"] == "7"
    assert float(row["x"]) == pytest.approx(there[0], abs=0.6)
    assert float(row["y"]) == pytest.approx(there[1], abs=0.6)
    assert "Aligned" in (out / "alignment.html").read_text()
    truth = tmp_path / "truth.txt"
    whole = OFF.about((0.0, 0.0))
    truth.write_text(f"{whole.x_m} {whole.y_m} {whole.z_m} {whole.yaw_deg}")
    assert main(["evaluate", "alignment", str(out), "--truth", str(truth), "--json"]) == exit_codes.GOOD
    found = json.loads(capsys.readouterr().out)
    assert found["summary"]["right"] == 1
    assert found["summary"]["median_m"] < 0.5
    assert found["summary"]["median_up_m"] < 0.2


def test_what_cannot_be_told_moves_nothing_and_takes_older_products_away(maps, tmp_path):
    air, _, stand = maps
    few = stand.trees[np.hypot(*(stand.trees[:, :2] - stand.middle_m).T) < 9.0][:8]
    table, out = tmp_path / "stems.csv", tmp_path / "stems_aligned"
    table.write_text("x,y\n" + "\n".join(f"{x:.2f},{y:.2f}" for x, y in few[:, :2]))
    out.mkdir()
    (out / "stems_aligned.csv").write_text("of an earlier run")
    assert main(["align", str(air), str(table), "--trees", str(table), *SEARCH]) == exit_codes.WARNINGS
    assert not (out / "stems_aligned.csv").exists()
    assert json.loads((out / "alignment.json").read_text())["verdict"] == "not enough to tell"
    assert "Not enough to tell" in (out / "alignment.html").read_text()


@pytest.mark.parametrize(
    "call",
    [
        (["--start", "here"], exit_codes.USAGE, "two or three numbers"),
        (["--start", "600000,5400000"], exit_codes.FAILED, "100.0 km"),
        (["--turn", "400"], exit_codes.USAGE, "up to 180"),
    ],
)
def test_a_wrong_call_is_refused_with_the_reason(maps, tmp_path, capsys, call):
    air, _, _ = maps
    extra, code, says = call
    table = tmp_path / "stems.csv"
    table.write_text("x,y\n0,0\n5,5\n")
    assert main(["align", str(air), str(table), *extra]) == code
    assert says in capsys.readouterr().err
