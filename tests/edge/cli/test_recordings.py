"""The commands about recordings: what they print, and how they end."""

import argparse
import json

import pytest

from edge.cli import exit_codes, info, recover, validate
from edge.errors import FormatError, RecordingError
from tests.edge.recordings import read_messages, write_recording
from tests.edge.sessions import write_session

OURS = {"software": "0.1", "mission": "north", "config_toml": ""}


def call(module, *words, as_json=False):
    parser = argparse.ArgumentParser()
    module.add_arguments(parser)
    args = parser.parse_args([str(word) for word in words])
    args.config, args.json, args.verbose = None, as_json, False
    return module.run(args)


@pytest.fixture
def good(tmp_path):
    return write_session(tmp_path / "walk_0.mcap", session=OURS)


@pytest.mark.parametrize("module", [validate, recover, info])
def test_help_says_what_and_shows_an_example(module):
    first, *rest = module.HELP.splitlines()
    assert len(first) < 80
    assert any(line.startswith("example: mapforest") for line in rest)


def test_validate_says_pass(good, capsys):
    assert call(validate, good) == exit_codes.GOOD
    out = capsys.readouterr().out
    assert out.startswith("PASS")
    assert "/livox/imu" in out


def test_validate_says_what_is_wrong(tmp_path, capsys):
    warn = write_session(tmp_path / "warn_0.mcap", session=OURS, changes={"video": {"start_s": 6.0}})
    fail = write_session(tmp_path / "fail_0.mcap", session=OURS, changes={"imu": {"end_s": 10.0}})
    assert call(validate, warn) == exit_codes.WARNINGS
    assert "warn The camera began only 6.0 s after the start" in capsys.readouterr().out
    assert call(validate, fail) == exit_codes.FAILED
    assert "FAIL The motion sensor of the laser scanner stopped 10.0 s before the end" in capsys.readouterr().out


def test_validate_for_programs(good, capsys):
    assert call(validate, good, as_json=True) == exit_codes.GOOD
    report = json.loads(capsys.readouterr().out)
    assert report["verdict"] == "PASS"
    assert {topic["name"]: topic["level"] for topic in report["topics"]}["/livox/imu"] == "NOTE"


def test_info_lists_topics(good, tmp_path, capsys):
    assert call(info, good) == exit_codes.GOOD
    out = capsys.readouterr().out
    assert "mission north" in out
    assert "sensor_msgs/msg/PointCloud2" in out
    assert "200..200" in out
    assert call(info, good, as_json=True) == exit_codes.GOOD
    found = json.loads(capsys.readouterr().out)
    assert {topic["name"]: topic["count"] for topic in found["topics"]}["/livox/imu"] == 4000
    good.write_bytes(good.read_bytes()[:-5000])
    assert call(info, tmp_path) == exit_codes.WARNINGS
    assert "not closed" in capsys.readouterr().out


def test_info_of_an_empty_recording(tmp_path, capsys):
    write_recording(tmp_path / "none.mcap", seconds=0.0)
    assert call(info, tmp_path / "none.mcap") == exit_codes.GOOD
    assert "0 messages" in capsys.readouterr().out


def test_recover_ends_as_documented(tmp_path, capsys):
    whole = write_recording(tmp_path / "whole.mcap")
    assert call(recover, whole, "-o", tmp_path / "copy.mcap") == exit_codes.GOOD
    assert "Nothing was lost" in capsys.readouterr().out
    torn = tmp_path / "torn.mcap.active"
    torn.write_bytes(whole.read_bytes()[:20_000])
    assert call(recover, torn) == exit_codes.WARNINGS
    assert "could not be kept" in capsys.readouterr().out
    assert read_messages(tmp_path / "torn_recovered.mcap")
    with pytest.raises(RecordingError, match="exists already"):
        call(recover, torn)
    with pytest.raises(FormatError, match="no such file"):
        call(recover, tmp_path / "none.mcap")


def test_recover_for_programs_and_of_a_folder(tmp_path, capsys):
    folder = tmp_path / "walk"
    folder.mkdir()
    whole = write_recording(folder / "walk_0.mcap")
    (folder / "walk_1.mcap.active").write_bytes(whole.read_bytes()[:20_000])
    (folder / "walk_2.mcap.active").write_bytes(b"")
    assert call(recover, folder, as_json=True) == exit_codes.WARNINGS
    told = json.loads(capsys.readouterr().out)
    assert [file["lossless"] for file in told["files"]] == [True, False]
    assert "empty" in told["failed"]["walk_2.mcap.active"]
    out = tmp_path / "walk_recovered"
    assert sorted(path.name for path in out.iterdir()) == ["metadata.yaml", "walk_0.mcap", "walk_1.mcap"]
    assert read_messages(out / "walk_0.mcap") == read_messages(whole)
    (tmp_path / "void").mkdir()
    (tmp_path / "void" / "a.mcap").write_bytes(b"")
    with pytest.raises(RecordingError, match="nothing in"):
        call(recover, tmp_path / "void")
    assert not (tmp_path / "void_recovered").exists()
