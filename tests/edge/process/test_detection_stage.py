"""A model over a session's video: what it says of which image, and which model it was."""

from __future__ import annotations

import importlib
import json

import msgspec
import numpy as np
import pytest

from edge.cli.main import main
from edge.config import Config, Detection
from edge.errors import ConfigError, FormatError
from edge.process import process as module
from edge.process.detections_file import read_detections
from edge.process.process import Task, process
from pipeline.detection.errors import ModelUnreadable
from tests.edge.process.test_process import fakes
from tests.edge.replay import foreign, videos
from tests.edge.replay.foreign import START_NS, SWEEP_NS

pytest.importorskip("onnxruntime", reason="the detector's runtime is an extra")
pytest.importorskip("onnx", reason="models for tests are built with onnx")
models = importlib.import_module("tests.pipeline.detection.models")

BOX = (32, 64, 64, 96)
"""Where red stands in every second of the pictures: one cell of the model, and of the codec."""


def pictures(count: int):
    for index in range(count):
        image = np.full((96, 160, 3), 90, np.uint8)
        if index // 15 % 2:
            left, top, right, bottom = BOX
            image[top:bottom, left:right] = (0, 0, 255)
        yield image


def walk(*, codec: str = "h264", frames: int = 60) -> foreign.Bag:
    bag = foreign.walk(foreign.custom, sweeps=20)
    for k in range(20):
        bag.add("/fix", START_NS + k * SWEEP_NS, foreign.fix(START_NS + k * SWEEP_NS))
    for index, unit in videos.encoded(pictures(frames)):
        stamp_ns = START_NS + 7 + index * videos.PERIOD_NS
        bag.add("/cam", stamp_ns + 5_000_000, foreign.video(stamp_ns, unit, codec))
    return bag


@pytest.fixture
def recording(tmp_path):
    return walk().write(tmp_path / "walk.mcap")


@pytest.fixture
def model(tmp_path):
    return models.spotter(tmp_path / "spot.onnx", (96, 160), description="for demonstration")


def with_model(model, **changes) -> Config:
    return Config(detection=Detection(**{"model": str(model), "rate_hz": 4.0, **changes}))


def test_detections_are_kept_by_stamp_with_the_model_that_made_them(recording, model):
    done = process(Task([recording]), with_model(model), load=fakes())
    made, found = read_detections(done.folder / "detections.msgpack")
    assert (made.name, made.device, made.class_names, made.confidence) == ("spot", "cpu", ("red", "blue"), 0.35)
    stamps = [START_NS + 7 + index * videos.PERIOD_NS for index in (0, 8, 15, 23, 30, 38, 45, 53)]
    assert [one.stamp_ns for one in found] == stamps
    assert [len(one) for one in found] == [0, 0, 1, 1, 0, 0, 1, 1]
    np.testing.assert_allclose(found[2].boxes_px, [BOX], atol=1e-6)
    assert (found[2].width_px, found[2].height_px, found[2].class_id.tolist()) == (160, 96, [0])
    told = done.facts.detection
    assert told is not None
    assert (told.model, told.images, told.boxes) == (made, 8, 4)
    assert f"detector spot (sha256 {made.sha256[:12]}) on cpu: 4 boxes in 8 images" in done.facts.notes
    assert any("for demonstration only" in note for note in done.facts.notes)
    assert "detections.msgpack" in done.facts.files


def test_it_is_done_once_and_again_only_when_it_would_be_different(recording, model):
    config = with_model(model)
    all_stages = ("odometry", "fusion", "detection", "grounding", "products")
    assert process(Task([recording]), config, load=fakes()).redone == all_stages
    assert process(Task([recording]), config, load=None).redone == ()
    finer = with_model(model, rate_hz=10.0)
    assert process(Task([recording]), finer, load=None).redone == ("detection", "grounding", "products")
    other = models.spotter(model.parent / "other.onnx", (96, 160), names=("red",))
    assert process(Task([recording]), with_model(other), load=None).redone == ("detection", "grounding", "products")
    plain = process(Task([recording]), Config(), load=None)
    assert plain.redone == ("products",)
    assert plain.facts.detection is None
    assert not (plain.folder / "detections.msgpack").exists()


def test_a_recording_without_a_camera_says_so_and_goes_on(tmp_path, model):
    done = process(
        Task([foreign.walk(foreign.custom, sweeps=8).write(tmp_path / "blind.mcap")]), with_model(model), load=fakes()
    )
    assert any("there is no video in the recording" in note for note in done.facts.notes)
    assert read_detections(done.folder / "detections.msgpack")[1] == []


def test_a_video_that_cannot_be_decoded_is_told_and_the_rest_is_made(tmp_path, model):
    done = process(Task([walk(codec="h265", frames=3).write(tmp_path / "w.mcap")]), with_model(model), load=fakes())
    assert any("its video is 'h265'" in note for note in done.facts.notes)
    assert done.facts.frame == "map"


def test_a_wrong_model_is_told_before_the_odometry_begins(recording, tmp_path):
    junk = tmp_path / "junk.onnx"
    junk.write_bytes(b"nonsense")
    with pytest.raises(ModelUnreadable, match=r"junk\.onnx"):
        process(Task([recording]), with_model(junk), load=None)
    with pytest.raises(ModelUnreadable, match="No such file"):
        process(Task([recording]), with_model(tmp_path / "gone.onnx"), load=None)


def test_the_model_that_comes_along_is_told_where_it_does_not(recording, monkeypatch, tmp_path):
    monkeypatch.setattr("edge.detection.DEMO_MODEL", tmp_path / "ailanthus-demo.onnx")
    with pytest.raises(ConfigError, match=r"has no ailanthus-demo\.onnx"):
        process(Task([recording]), with_model("demo"), load=None)


def test_other_files_are_no_detections(tmp_path):
    path = tmp_path / "x.msgpack"
    path.write_bytes(msgspec.msgpack.encode({"frames": []}))
    with pytest.raises(FormatError, match="not detections of"):
        read_detections(path)


def test_the_command_takes_a_model(recording, model, capsys, monkeypatch):
    monkeypatch.setattr(module.process, "__defaults__", (None, fakes()))
    assert main(["process", str(recording), "--detect", str(model), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["detection"]["model"]["name"] == "spot"
    assert told["redone"] == ["odometry", "fusion", "detection", "grounding", "products"]
    assert main(["process", str(recording), "--detect", str(model) + "x"]) == 1
    assert "cannot be read" in capsys.readouterr().err


def test_a_model_once_named_is_used_again_until_none_is_asked_for(recording, model, capsys, monkeypatch):
    monkeypatch.setattr(module.process, "__defaults__", (None, fakes()))
    monkeypatch.chdir(model.parent)
    looked = []
    for more in (["--detect", model.name], [], ["--detect", ""], []):
        assert main(["process", str(recording), "--json", *more]) == 0
        told = json.loads(capsys.readouterr().out)
        looked.append((told["detection"] is not None, told["redone"]))
        monkeypatch.chdir(recording.parent)
    assert [one for one, _ in looked] == [True, True, False, False]
    assert looked[1][1] == looked[3][1] == []
