"""The detector before a walk."""

from __future__ import annotations

import importlib

import pytest

from edge.config import Config, Detection
from edge.preflight import detection
from edge.preflight.check import Outcome
from edge.preflight.detection import check_detection

pytest.importorskip("onnxruntime", reason="the detector's runtime is an extra")
pytest.importorskip("onnx", reason="models for tests are built with onnx")
models = importlib.import_module("tests.pipeline.detection.models")


def config(model, **changes) -> Config:
    return Config(detection=Detection(**{"model": str(model), "core_share": 8.0, **changes}))


def test_without_a_model_there_is_nothing_to_check():
    (check,) = check_detection(Config())
    assert (check.subject, check.outcome) == ("detector", Outcome.GOOD)


def test_a_model_that_loads_is_told_with_its_device_and_pace(tmp_path):
    (check,) = check_detection(config(models.spotter(tmp_path / "spot.onnx")))
    assert check.outcome is Outcome.GOOD
    assert check.found.startswith("spot (sha256 ")
    assert "on cpu: " in check.found
    assert check.found.endswith(" ms an image")


def test_a_model_too_slow_for_its_share_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("pipeline.detection.detector.Detector.time_s", lambda *_: 0.5)
    (check,) = check_detection(config(models.spotter(tmp_path / "spot.onnx"), core_share=0.5))
    assert check.outcome is Outcome.WARNING
    assert "500 ms an image, 1.0 a second live instead of 2" in check.found


@pytest.mark.parametrize("content", [None, b"nonsense"])
def test_a_model_that_is_missing_or_wrong_is_bad_and_says_why(tmp_path, content):
    path = tmp_path / "m.onnx"
    if content is not None:
        path.write_bytes(content)
    (check,) = check_detection(config(path))
    assert (check.outcome, bool(check.advice)) == (Outcome.BAD, True)
    assert str(path) in check.found


def test_a_demonstration_and_two_runtimes_are_told(tmp_path, monkeypatch):
    monkeypatch.setattr(detection, "_installed", lambda _package: True)
    checks = check_detection(config(models.spotter(tmp_path / "spot.onnx", purpose="demonstration")))
    assert [check.outcome for check in checks] == [Outcome.GOOD, Outcome.WARNING, Outcome.WARNING]
    assert "for demonstration only" in checks[1].found
    assert "are both installed" in checks[2].found


def test_a_gpu_that_is_not_used_is_told(tmp_path, monkeypatch):
    runtime = importlib.import_module("pipeline.detection.runtime").runtime()
    monkeypatch.setattr(runtime, "get_available_providers", lambda: ["CUDAExecutionProvider", "CPUExecutionProvider"])
    path = models.spotter(tmp_path / "spot.onnx")
    monkeypatch.setattr("pipeline.detection.runtime._providers", lambda *_: ["CPUExecutionProvider"])
    assert check_detection(config(path))[1].found == "this onnxruntime is made for a GPU, and runs on the processor"
    assert len(check_detection(config(path, device="cpu"))) == 1
