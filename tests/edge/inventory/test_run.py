import csv
import errno
import json
import os
import re

import laspy
import numpy as np
import pyogrio
import pyproj
import pytest

from edge.cli import exit_codes
from edge.cli.main import main
from edge.inventory.pages import write_pages
from pipeline.inventory.trees import ListedTree, TreeList
from tests.pipeline.inventory.plots import PlotMap, Trunk

TRUNKS = [
    *(Trunk(-6, 5, 0.31), Trunk(0, 8, 0.22), Trunk(5, 4, 0.14)),
    *(Trunk(9, -7, 0.40), Trunk(-3, -9, 0.18), Trunk(-9, -4, 0.26)),
]


@pytest.fixture(scope="module")
def plot(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plot")
    path = PlotMap(TRUNKS, noise=(0.0005, 0.006)).save(folder / "plot.laz", pyproj.CRS(32618))
    assert main(["inventory", str(path)]) == exit_codes.GOOD
    return path


def table(plot):
    with (plot.parent / "plot_inventory" / "trees.csv").open() as file:
        return list(csv.DictReader(file))


def test_others_open_what_is_written(plot):
    folder = plot.parent / "plot_inventory"
    assert len(table(plot)) == len(TRUNKS)
    about, _, shapes, _ = pyogrio.raw.read(folder / "trees.gpkg", layer="trees")
    assert (about["crs"], len(shapes)) == ("EPSG:32618", len(TRUNKS))
    points = laspy.read(folder / "trees.laz")
    assert points.header.parse_crs().to_epsg() == 32618
    number = next(int(row["tree_id"]) for row in table(plot) if abs(float(row["x"]) - 450_014) < 1)
    mine = points.xyz[(points["tree_id"] == number) & (points["height_above_ground"] < 3)]
    np.testing.assert_allclose(mine[:, :2].mean(axis=0), (450_014, 5_200_025), atol=0.15)
    page = (folder / "plot.html").read_text()
    assert page.count("slice of tree") == len(TRUNKS)
    assert "http" not in page


def test_many_trees_have_a_page_over_all_and_one_for_each_square(tmp_path):
    (tmp_path / "squares").mkdir()
    (tmp_path / "squares" / "of_an_earlier_run.html").touch()
    places = np.random.default_rng(1).uniform((450_000, 5_200_000, 0), (450_100, 5_200_100, 1), (500, 3))
    trees = [ListedTree(k + 1, at, 0.2, 0.01, 12.0, 3.0) for k, at in enumerate(places)]
    write_pages(tmp_path, TreeList(trees, []), ["a note"])
    page = (tmp_path / "plot.html").read_text()
    links = re.findall(r'href="(squares/[^"]+)"', page)
    assert sorted(tmp_path.glob("squares/*")) == sorted(tmp_path / link for link in links)
    assert page.count("h0") >= 500
    assert "a note" in page
    shown = [
        number for link in links for number in re.findall(r'data-label="Tree">(\d+)', (tmp_path / link).read_text())
    ]
    assert sorted(map(int, shown)) == list(range(1, 501))
    write_pages(tmp_path, TreeList(trees[:3], []), [])
    assert not (tmp_path / "squares").exists()


def test_decisions_survive_and_a_second_run_begins_with_them(plot):
    folder = plot.parent / "plot_inventory"
    rows = table(plot)
    with (folder / "tree_edits.csv").open("a") as file:
        file.write(f"delete,{rows[0]['x']},{rows[0]['y']},,,,,a pole\nadd,450020,5200020,18,,,,\n")
    assert main(["inventory", str(plot), "--no-laz"]) == exit_codes.GOOD
    again = table(plot)
    assert [row["tree_id"] for row in again] == [*(row["tree_id"] for row in rows[1:]), str(len(rows) + 1)]
    assert again[-1]["status"] == "added"
    assert "a pole" in (folder / "rejected.csv").read_text()
    assert "a pole" in (folder / "tree_edits.csv").read_text()


def test_diameters_are_evaluated_and_the_device_bias_is_fitted(plot, tmp_path, capsys):
    field = tmp_path / "field.csv"
    rows = [f"{450_020 + t.x},{5_200_020 + t.y},{100 * t.dbh - 1}\n" for t in TRUNKS]
    field.write_text("x,y,dbh_cm\n" + "".join(rows))
    folder = tmp_path / "out"
    assert (
        main(["inventory", str(plot), "--output", str(folder), "--marked", str(field), "--no-laz"]) == exit_codes.GOOD
    )
    bias = json.loads((folder / "device_bias.json").read_text())
    assert bias["marked"] == len(TRUNKS)
    assert 0.004 < bias["offset_m"] < 0.016
    capsys.readouterr()
    page = tmp_path / "page.html"
    asked = ["evaluate", "diameters", str(folder), "--truth", str(field), "--page", str(page), "--json"]
    assert main(asked) == exit_codes.GOOD
    told = json.loads(capsys.readouterr().out)
    assert (told["found"], told["made_up"], told["completeness"]) == (len(TRUNKS), 0, 1.0)
    assert abs(told["bias_m"]) < 0.006
    assert page.stat().st_size > 1000


def test_no_trees_are_an_empty_table_with_the_reason(tmp_path, capsys):
    path = PlotMap([]).save(tmp_path / "bare.laz")
    assert main(["inventory", str(path), "--no-laz", "--json"]) == exit_codes.WARNINGS
    told = json.loads(capsys.readouterr().out)
    assert told["trees"] == 0
    assert told["why"]
    assert (tmp_path / "bare_inventory" / "trees.csv").read_text().startswith("tree_id,")


def test_a_full_disk_is_told_with_what_to_do(plot, tmp_path, capsys, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("pipeline.inventory.blocks.BlockStore.flush", full)
    assert main(["inventory", str(plot), "--output", str(tmp_path / "out"), "--no-laz"]) == exit_codes.FAILED
    assert "No space left on device; make room" in capsys.readouterr().err


def test_what_is_no_map_is_told(tmp_path, capsys):
    assert main(["inventory", str(tmp_path)]) == exit_codes.FAILED
    assert "mapforest process" in capsys.readouterr().err
    (tmp_path / "a.laz").write_bytes(b"nonsense")
    assert main(["inventory", str(tmp_path / "a.laz")]) == exit_codes.FAILED
    assert "a.laz" in capsys.readouterr().err


def test_a_field_list_by_compass_and_tape_numbers_the_trees(plot, tmp_path, capsys):
    field = tmp_path / "field.csv"
    rows = []
    for number, trunk in enumerate(TRUNKS, start=7):
        away, bearing = np.hypot(trunk.x, trunk.y), np.degrees(np.arctan2(trunk.x, trunk.y)) + 33.0
        rows.append(f"{number},{away:.2f},{bearing % 360:.1f},{100 * trunk.dbh:.1f}\n")
    field.write_text("tag,distance_m,azimuth_deg,dbh_cm\n" + "".join(rows) + "99,11,0,24\n")
    folder = tmp_path / "out"
    asked = ["inventory", str(plot), "--output", str(folder), "--field-list", str(field), "--no-laz", "--json"]
    assert main(asked) == exit_codes.GOOD
    told = json.loads(capsys.readouterr().out)["field_list"]
    assert (told["listed"], told["matched"]) == (len(TRUNKS) + 1, len(TRUNKS))
    with (folder / "trees.csv").open() as file:
        trees = {row["tag"]: row for row in csv.DictReader(file)}
    for number, trunk in enumerate(TRUNKS, start=7):
        assert float(trees[str(number)]["x"]) == pytest.approx(450_020 + trunk.x, abs=0.1)
        assert float(trees[str(number)]["field_dbh_cm"]) == pytest.approx(100 * trunk.dbh, abs=0.1)
    with (folder / "field_unmatched.csv").open() as file:
        assert [(row["tag"], row["why"]) for row in csv.DictReader(file)] == [("99", "no stem was found there")]


def test_april_tags_of_a_map_without_video_are_refused_at_once(plot, tmp_path, capsys):
    assert main(["inventory", str(plot), "--april-tags", "--output", str(tmp_path / "out")]) == exit_codes.FAILED
    assert "in the video of a session" in capsys.readouterr().err
