"""What the recorder writes, the validator and the repair understand."""

import shutil
from collections import Counter

import pytest
from rosbags.highlevel import AnyReader

from drivers.messages import FixQuality
from edge.recording.account import SessionAbout
from edge.recording.recover import finish_in_place
from edge.recording.recover_folder import recover_folder
from edge.recording.session import SessionRecorder, session_folder
from edge.validation.files import recording_files
from edge.validation.info import info
from edge.validation.validate import validate
from tests.edge.recording.recording_scene import (
    MS,
    FakeClock,
    FaultyDisk,
    S,
    diagnostics,
    fix,
    imu,
    limits,
    nmea,
    scan,
    video,
)

SECONDS = 12


def session(root, compression="none", quality=FixQuality.RTK_FIXED):
    clock = FakeClock()
    config = limits(split_s=5.0, compression=compression)
    folder = session_folder(root, "walk", clock.anchor())
    recorder = SessionRecorder(
        folder, SessionAbout(software="0.1"), config, clock.anchor(), clock=clock, disk=FaultyDisk()
    )
    recorder.start()
    messages = [diagnostics(k * S) for k in range(SECONDS)]
    messages += [scan(k * 100 * MS) for k in range(SECONDS * 10)]
    messages += [imu(k * 5 * MS) for k in range(SECONDS * 200)]
    messages += [fix(k * 200 * MS, quality) for k in range(SECONDS * 5)]
    messages += [nmea(k * 100 * MS) for k in range(SECONDS * 10)]
    messages += [video(k * 33_366_700) for k in range(SECONDS * 29)]
    for message in sorted(messages, key=lambda one: one.receive_ns):
        recorder.offer(message)
    return recorder.stop("operator")


@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_a_recorded_session_passes(tmp_path, compression):
    result = session(tmp_path, compression)
    report = validate(result.folder)
    assert report.verdict == "PASS", report.reasons
    assert report.own
    counted = {topic.name: topic.count for topic in report.topics if topic.count}
    assert counted == dict(result.counts)
    assert report.gnss.qualities == {"RTK fixed": SECONDS * 5}
    assert info([result.folder]).session["software"] == "0.1"
    assert info([result.folder]).ended == "operator"


def test_single_fixes_are_told_from_none(tmp_path):
    report = validate(session(tmp_path, quality=FixQuality.INVALID).folder)
    assert report.verdict == "WARN"
    assert report.gnss.fix_share == 0


def test_fixes_read_directly_agree_with_the_count(tmp_path):
    result = session(tmp_path)
    last = recording_files([result.folder])[-1]
    last.write_bytes(last.read_bytes()[:-40_000])
    finish_in_place(last)
    report = validate(result.folder)
    assert report.gnss.source == "every fix"
    assert report.gnss.fix_share == 1
    assert any("cut off (power?)" in reason for reason in report.reasons)


def test_a_cut_session_is_recovered_into_a_bag_that_others_open(tmp_path):
    result = session(tmp_path)
    cut = tmp_path / "cut"
    shutil.copytree(result.folder, cut)
    last = recording_files([cut])[-1]
    last.rename(last.with_name(last.name + ".active"))
    last = recording_files([cut])[-1]
    last.write_bytes(last.read_bytes()[:-40_000])
    reports, failed = recover_folder(recording_files([cut]), cut, tmp_path / "sound")
    assert not failed
    assert [report.lossless for report in reports] == [True] * (len(reports) - 1) + [False]
    kept = sum((Counter(report.topics) for report in reports), Counter())
    with AnyReader([tmp_path / "sound"]) as bag:
        assert Counter(connection.topic for connection, _, _ in bag.messages()) == kept
    assert (tmp_path / "sound" / "session.json").exists()
