"""A processed session is compared with the simulated truth in its time and at its place."""

from __future__ import annotations

import json

import msgspec
import numpy as np
import pytest

from edge.cli.main import main
from edge.cli.trajectories import agreement
from edge.errors import FormatError
from edge.process.against_truth import APART, find_pairs
from edge.process.product_facts import ProductFacts
from pipeline.evaluation.pair import compare
from pipeline.gnss.geodesy import Datum
from pipeline.products.covariance import pose_table, read_covariance, write_covariance
from pipeline.products.track import ESTIMATE
from pipeline.products.tum import write_tum
from tests.edge import live_recordings

WORLD, HERE = Datum(40.0, -75.0, 58.0), Datum(40.0002, -75.0003, 61.0)
EPOCH_NS, OFFSET_NS = 5_000_000_000, 1_790_000_000_000_000_000
COUNT = 300


@pytest.fixture
def truth(tmp_path):
    folder = tmp_path / "truth"
    folder.mkdir()
    stamps = np.arange(COUNT) * 10**8
    write_tum(folder / "poses.tum", stamps, positions(), np.tile(np.eye(3), (COUNT, 1, 1)))
    datum = {"latitude_deg": WORLD.latitude_deg, "longitude_deg": WORLD.longitude_deg, "height_m": WORLD.height_m}
    (folder / "world.json").write_text(json.dumps({"datum": datum}))
    (folder / "epoch.json").write_text(json.dumps({"monotonic_ns": EPOCH_NS}))
    return folder


def positions() -> np.ndarray:
    angles = np.linspace(0, 2 * np.pi, COUNT)
    return np.column_stack([30 * np.cos(angles), 30 * np.sin(angles), np.sin(angles)])


@pytest.fixture
def session(tmp_path):
    products = tmp_path / "walk" / "products"
    products.mkdir(parents=True)
    stamps = np.arange(COUNT) * 10**8 + EPOCH_NS + OFFSET_NS
    off = np.array([0.1, -0.2, 0.3])
    here = np.array([HERE.enu(*WORLD.geodetic(one + off)) for one in positions()])
    level = np.tile(np.eye(3), (COUNT, 1, 1))
    write_tum(products / "trajectory.tum", stamps, here, level)
    write_tum(products / "trajectory_odom.tum", stamps, positions() - positions()[0], level)
    track = np.zeros(COUNT, ESTIMATE)
    track["stamp_ns"] = stamps
    covariance = np.tile(np.diag([0.04, 0.04, 0.09, 0, 0, 0]), (COUNT, 1, 1))
    covariance[:, 0, 1] = covariance[:, 1, 0] = -0.01
    write_covariance(products / "covariance.csv", pose_table("map", track, here, covariance))
    back = read_covariance(products / "covariance.csv")
    np.testing.assert_allclose(back.covariance[:, :3, :3], covariance[:, :3, :3], rtol=1e-5)
    datum = (HERE.latitude_deg, HERE.longitude_deg, HERE.height_m)
    facts = ProductFacts("walk", "map", "EPSG:32618", datum=datum, host_offset_ns=OFFSET_NS)
    (products / "products.json").write_bytes(msgspec.json.encode(facts))
    return tmp_path / "walk"


def test_time_and_datum_are_those_of_the_truth(session, truth):
    found = {(one.trajectory, one.errors.alignment): one.errors for one in compare(find_pairs(session, truth), 20.0)}
    assert list(found) == [("map", "none"), ("map", "yaw"), ("map", "se3"), ("odom", "yaw"), ("odom", "se3")]
    assert found["map", "none"].ape_m.rmse == pytest.approx(0.14**0.5, abs=2e-3)
    assert found["map", "none"].ape_vertical_m.rmse == pytest.approx(0.3, abs=2e-3)
    expected = np.array([0.1, -0.2, 0.3]) @ np.linalg.inv([[0.04, -0.01, 0], [-0.01, 0.04, 0], [0, 0, 0.09]])
    assert found["map", "none"].nees == pytest.approx(expected @ [0.1, -0.2, 0.3] / 3, rel=0.02)
    assert found["odom", "yaw"].ape_m.rmse < 1e-5
    assert found["map", "yaw"].ape_m.rmse < 2e-3


def add_live(session, tmp_path, off, covariance):
    """A live pipeline beside it, with a datum of its own; `off`: of its poses from the true ones."""
    stamps, other = np.arange(COUNT) * 10**8 + EPOCH_NS, Datum(39.9999, -74.9998, 40.0)
    sent = []
    for stamp, at in zip(stamps.tolist(), positions(), strict=True):
        placed = np.array(other.enu(*WORLD.geodetic(at + off)))
        odom_m = at - positions()[0]
        sent += live_recordings.told(stamp, np.eye(3), covariance, odom_m=odom_m, map_m=placed, datum=other)
    for path in live_recordings.record(tmp_path / "recorded", sent).glob("*.mcap"):
        path.rename(session / path.name)


def test_live_poses_are_compared_on_the_earth_and_with_the_offline_ones(session, truth, tmp_path, capsys):
    off = np.array([0.2, -0.1, 0.6])
    add_live(session, tmp_path, off, np.diag([0.05, 0.05, 0.16, 0, 0, 0]))
    found = {(one.trajectory, one.errors.alignment): one.errors for one in compare(find_pairs(session, truth), 20.0)}
    assert [name for name, kind in found if kind == "se3"] == ["map", "odom", "live map", "live odom"]
    assert found["live map", "none"].ape_m.rmse == pytest.approx(np.linalg.norm(off), abs=2e-3)
    assert found["live map", "none"].nees == pytest.approx((0.04 / 0.05 + 0.01 / 0.05 + 0.36 / 0.16) / 3, rel=0.02)
    assert found["live odom", "yaw"].ape_m.rmse < 1e-5
    apart = off - [0.1, -0.2, 0.3]
    both = np.array([[0.09, -0.01, 0], [-0.01, 0.09, 0], [0, 0, 0.25]])
    assert found[APART, "none"].ape_m.rmse == pytest.approx(np.linalg.norm(apart), abs=2e-3)
    assert found[APART, "none"].nees == pytest.approx(apart @ np.linalg.inv(both) @ apart / 3, rel=0.02)
    assert main(["evaluate", "trajectory", str(session), "--truth", str(truth), "--over", "20"]) == 0
    out = capsys.readouterr().out
    assert "live - offline: 0.332 m rms, 0.332 m worst, 100% in the 95 % ellipsoid: agree\n" in out
    assert max(map(len, out.splitlines())) <= 80


def test_live_poses_surer_than_they_are_right_disagree(session, truth, tmp_path):
    add_live(session, tmp_path, np.array([2.0, -0.1, 0.6]), np.diag([0.05, 0.05, 0.16, 0, 0, 0]))
    assert agreement(compare(find_pairs(session, truth))).endswith("0% in the 95 % ellipsoid: disagree")


def test_the_command_prints_a_table_and_json(session, truth, capsys):
    assert main(["evaluate", "trajectory", str(session), "--truth", str(truth), "--over", "20"]) == 0
    assert "RPE over 20 m" in capsys.readouterr().out
    tum = session / "products" / "trajectory_odom.tum"
    assert main(["evaluate", "trajectory", str(tum), "--truth", str(tum), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["errors"]["ape_m"]["worst"] == 0


def test_the_command_writes_a_page_where_it_is_asked_to(session, truth, tmp_path, capsys):
    page = tmp_path / "plots.html"
    arguments = ["evaluate", "trajectory", str(session), "--truth", str(truth), "--page"]
    assert main([*arguments, str(page)]) == 0
    text = page.read_text()
    assert "Trajectories of walk" in text
    assert [word in text for word in ("<h2>map<", "<h2>odom<", "<h2>live")] == [True, True, False]
    assert main([*arguments, str(tmp_path / "nowhere" / "plots.html")]) == 1
    assert "give another place with --page" in capsys.readouterr().err
    assert main(["evaluate", "clocks", str(session), "--truth", str(truth), "--page", str(page)]) == 2


def test_what_cannot_be_compared_is_said(session, truth, tmp_path):
    with pytest.raises(FormatError, match="not processed yet"):
        find_pairs(tmp_path, truth)
    with pytest.raises(FormatError, match="the truth is a TUM file"):
        find_pairs(session / "products" / "trajectory.tum", truth)
    with pytest.raises(FormatError, match="the truth is a TUM file"):
        find_pairs(session / "products" / "trajectory.tum", tmp_path / "nowhere.tum")
    (truth / "epoch.json").unlink()
    with pytest.raises(FormatError, match="not what the emulated payload writes"):
        find_pairs(session, truth)
