"""Frames of a recording: of each stretch of way the sharpest, with its place; by time where there are no poses."""

from __future__ import annotations

import dataclasses
import json

import cv2
import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from edge.cli import exit_codes
from edge.cli.main import main
from edge.config import Config
from edge.dataset.folder import DatasetFolder
from edge.dataset.frames import FramesTask, extract
from edge.dataset.image import digest, image_facts
from edge.dataset.way import Way, find_way, strides_m
from edge.errors import FormatError
from edge.process.product_facts import ProductFacts
from pipeline.gnss.geodesy import geodetic
from pipeline.products.tum import write_tum
from tests.edge.dataset import scenes
from tests.edge.dataset.scenes import DATUM, FRAME_NS, S
from tests.edge.recording.recording_scene import UTC_NS


def take(session, folder, **options):
    made = DatasetFolder.make(folder)
    report = extract(FramesTask(session, **options), Config(), made, lambda share: None)
    made.save()
    return report, DatasetFolder.open(folder)


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """12 s at 1 m/s, with what the live pipeline said from 1 s to 11 s."""
    return scenes.record(tmp_path_factory.mktemp("walk"), scenes.video(120), scenes.poses(1.0, 11.0))


def test_of_each_stretch_of_way_the_sharpest_frame_is_taken_with_its_place(walk, tmp_path):
    report, made = take(walk, tmp_path / "trees", every_m=2.0, site="slope")
    assert (report.chosen_by, report.site, report.session) == ("distance", "slope", walk.name)
    assert report.outside == 18 + 1  # 0.0 to 0.9 s, and 11.1 to 11.9 s
    assert report.added == len(made.records) == report.placed == 5
    assert report.travelled_m == pytest.approx(10.0, abs=0.11)
    for stretch, record in enumerate(made.records):
        at_s = (record.stamp_ns - UTC_NS) / S
        assert stretch <= (at_s - 1.0) / 2.0 < stretch + 1
        assert round(at_s * 10) % 5 == 2  # in focus
        assert record.travelled_m == pytest.approx(at_s - 1.0, abs=0.11)
        latitude, longitude, height = DATUM.geodetic(np.array([0.0, at_s, 0.0]))
        assert (record.latitude_deg, record.longitude_deg) == pytest.approx((latitude, longitude), abs=2e-9)
        assert record.height_m == pytest.approx(height, abs=0.01)


def test_the_files_are_what_the_manifest_says(walk, tmp_path):
    _, made = take(walk, tmp_path / "trees", quality=80)
    for record in made.records:
        data = made.image_path(record).read_bytes()
        assert record.sha256 == digest(data)
        facts = image_facts(data, record.image)
        assert (facts.width_px, facts.height_px) == (record.width_px, record.height_px) == scenes.SIZE
        assert facts.sharpness == pytest.approx(record.sharpness, rel=0.3)
        assert record.jpeg_quality == 80
        assert record.source == "field"
    fine = take(walk, tmp_path / "fine", quality=98)[1]
    smaller, larger = (sum(one.image_path(r).stat().st_size for r in one.records) for one in (made, fine))
    assert smaller < larger
    shown = cv2.imread(str(fine.image_path(fine.records[0])))
    seed = round((fine.records[0].stamp_ns - UTC_NS) / FRAME_NS) // 10
    assert np.abs(shown.astype(int) - scenes.picture(seed)).mean() < 12.0


def test_a_second_run_adds_nothing_and_other_sessions_add_to_the_same_dataset(walk, tmp_path):
    take(walk, tmp_path / "trees")
    again, made = take(walk, tmp_path / "trees")
    assert (again.added, again.already) == (0, 5)
    other = scenes.record(tmp_path / "other", scenes.video(60), scenes.poses(0.0, 6.0)).rename(tmp_path / "later")
    report, made = take(other, tmp_path / "trees")
    assert report.alike == 3  # the same scenes
    assert len(made.records) == 5


def test_products_of_a_processed_session_come_first(tmp_path):
    session = scenes.record(tmp_path, scenes.video(60), scenes.poses(0.0, 6.0, speed_m_s=9.0))
    products = session / "products"
    products.mkdir()
    stamps = UTC_NS + np.arange(61) * FRAME_NS
    at = np.column_stack([np.arange(61) * 0.1, np.zeros(61), np.full(61, 2.0)])
    turns = Rotation.identity(61).as_matrix()
    write_tum(products / "trajectory_odom.tum", stamps, at, turns)
    write_tum(products / "trajectory.tum", stamps, at + np.array([100.0, 50.0, 0.0]), turns)
    facts = ProductFacts(session.name, "map", "", datum=(47.0, 8.0, 500.0))
    (products / "products.json").write_bytes(msgspec.json.encode(facts))
    report, made = take(session, tmp_path / "trees", every_m=2.0)
    assert report.poses.endswith("trajectory_odom.tum")
    assert report.travelled_m == pytest.approx(6.0, abs=0.11)
    first = made.records[0]
    expected = DATUM.geodetic(np.array([100.0 + (first.stamp_ns - UTC_NS) / S, 50.0, 2.0]))
    assert (first.latitude_deg, first.longitude_deg, first.height_m) == pytest.approx(expected, abs=1e-6)
    (products / "trajectory_odom.tum").write_text("nonsense\n")
    with pytest.raises(FormatError, match="mapforest process"):
        find_way([session], Config())


def test_without_poses_frames_are_chosen_by_time_and_that_is_said(tmp_path, capsys):
    session = scenes.record(tmp_path, scenes.video(60))
    code = main(["dataset", "frames", str(session), "--output", str(tmp_path / "trees"), "--every-s", "2", "--json"])
    assert code == exit_codes.WARNINGS
    (report,) = json.loads(capsys.readouterr().out)
    assert report["chosen_by"] == "time"
    assert "mapforest process" in report["poses"]
    assert report["added"] == 3
    made = DatasetFolder.open(tmp_path / "trees")
    assert [(r.stamp_ns - UTC_NS) // (2 * S) for r in made.records] == [0, 1, 2]
    assert made.records[0].travelled_m is None
    assert made.records[0].latitude_deg is None
    assert made.records[0].site == "walk"


def test_standing_still_in_front_of_one_scene_gives_one_frame(tmp_path):
    still = scenes.record(tmp_path / "a", scenes.video(60, speed_m_s=0.0), scenes.poses(0.0, 6.0, speed_m_s=0.0))
    assert take(still, tmp_path / "trees")[0].added == 1
    unplaced = scenes.record(tmp_path / "b", scenes.video(60, speed_m_s=0.0))
    report, _ = take(unplaced, tmp_path / "others")
    assert (report.added, report.alike) == (1, 2)


def test_what_cannot_be_decoded_is_counted_and_the_rest_is_used(tmp_path):
    frames = scenes.video(90)
    frames[40] = dataclasses.replace(frames[40], data=b"\0\0\0\1\x41" + bytes(range(256)))
    session = scenes.record(tmp_path, frames[5:], scenes.poses(0.0, 9.0))
    report, made = take(session, tmp_path / "trees", every_m=1.0)
    assert report.lost == 25 + 20  # up to the first key frame, and from the broken frame to the next
    taken = {round((record.stamp_ns - UTC_NS) / FRAME_NS) for record in made.records}
    assert taken
    assert all(30 <= k < 40 or k >= 60 for k in taken)


def test_a_recording_without_video_or_with_none_that_can_be_used_is_an_error(tmp_path):
    with pytest.raises(FormatError, match="no video"):
        take(scenes.record(tmp_path / "a", scenes.poses(0.0, 1.0)), tmp_path / "trees")
    orphans = scenes.record(tmp_path / "b", scenes.video(20)[5:], scenes.poses(0.0, 2.0))
    with pytest.raises(FormatError, match="none of 15 frames"):
        take(orphans, tmp_path / "trees")


def test_nobody_knows_the_place_in_a_hole_of_the_trajectory(tmp_path):
    session = scenes.record(tmp_path, scenes.video(2), scenes.poses(0.0, 2.0), scenes.poses(5.0, 6.0))
    way = find_way([session], Config())
    assert isinstance(way, Way)
    there = way.place(UTC_NS + 1_950_000_000)
    assert there == pytest.approx(DATUM.geodetic(np.array([0.0, 1.95, 0.0])), abs=1e-6)
    assert there == pytest.approx(geodetic(DATUM.origin_m + DATUM.turn @ [0.0, 1.95, 0.0]), abs=1e-6)
    assert way.place(UTC_NS + 3 * S) is None
    assert way.place(UTC_NS + 9 * S) is None
    assert way.along_m(UTC_NS + 3_500_000_000) == pytest.approx(3.5, abs=0.11)


def test_the_way_counts_strides_and_no_trembling():
    rng = np.random.default_rng(1)
    trembling = rng.normal(0.0, 0.01, (2000, 3))
    assert strides_m(trembling)[-1] == 0.0
    straight = np.column_stack([np.linspace(0.0, 30.0, 2000), np.zeros((2000, 2))])
    assert strides_m(straight + trembling)[-1] == pytest.approx(30.0, rel=0.05)


@pytest.mark.parametrize("option", [["--every", "0"], ["--quality", "101"], ["--every-s", "-1"]])
def test_options_that_make_no_sense_are_refused(option, tmp_path):
    assert main(["dataset", "frames", "x", "--output", str(tmp_path / "t"), *option]) == exit_codes.USAGE
