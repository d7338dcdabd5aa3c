"""Model files in, boxes in the pixels of the image out; everything that is no such file is refused in words."""

from __future__ import annotations

import hashlib
import importlib

import numpy as np
import pytest

from pipeline.detection import runtime
from pipeline.detection.detector import Detector, Settings
from pipeline.detection.errors import (
    DetectionError,
    InferenceFailed,
    ModelForeign,
    ModelUnreadable,
    RuntimeMissing,
)
from pipeline.detection.layout import Layout

pytest.importorskip("onnxruntime", reason="the detector's runtime is an extra")
onnx = pytest.importorskip("onnx", reason="models for tests are built with onnx")
models = importlib.import_module("tests.pipeline.detection.models")

RED, BLUE = (0, 0, 255), (255, 0, 0)


def said(*boxes, classes: int = 1) -> np.ndarray:
    """(1, 4 + classes, 200): boxes given as cx, cy, w, h, score, class."""
    output = np.zeros((1, 4 + classes, 200), np.float32)
    for place, (*box, score, number) in enumerate(boxes):
        output[0, :4, place] = box
        output[0, 4 + number, place] = score
    return output


def yolov5() -> np.ndarray:
    """Of one class: cx, cy, w, h, objectness, score."""
    rng = np.random.default_rng(0)
    return np.hstack([rng.uniform(0, 90, (378, 4)), rng.random((378, 2))])[None].astype(np.float32)


def picture(height=480, width=848) -> np.ndarray:
    return np.full((height, width, 3), 90, np.uint8)


def test_a_red_and_a_blue_thing_are_found_where_they_are(tmp_path):
    detector = Detector(models.spotter(tmp_path / "spot.onnx"))
    image = picture()
    image[100:164, 200:264] = RED
    image[300:364, 600:700] = BLUE
    found = detector.detect(image, 77)
    assert (found.stamp_ns, found.width_px, found.height_px) == (77, 848, 480)
    names = [found.class_names[number] for number in found.class_id]
    for name, (left, top, right, bottom) in (("red", (200, 100, 264, 164)), ("blue", (600, 300, 700, 364))):
        boxes = found.boxes_px[[one == name for one in names]]
        assert len(boxes)
        centres = (boxes[:, :2] + boxes[:, 2:]) / 2
        assert (centres > [left - 20, top - 20]).all()
        assert (centres < [right + 20, bottom + 20]).all()
    assert (np.diff(found.confidence) <= 0).all()


@pytest.mark.parametrize("layout", ["rows", "columns", "final"])
def test_boxes_of_every_layout_come_back_in_pixels_of_the_image(tmp_path, layout):
    # The input is 96 x 64; an image of 192 x 96 lies in it at half its size, 8 pixels from the top.
    output = said((30, 28, 20, 10, 0.9, 0), (31, 28, 20, 10, 0.8, 0), (60, 30, 10, 10, 0.2, 0))
    if layout == "columns":
        output = output.transpose(0, 2, 1).copy()
    elif layout == "final":
        output = np.zeros((1, 50, 6), np.float32)
        output[0, 0] = [20, 23, 40, 33, 0.9, 0]
    detector = Detector(models.constant(tmp_path / "m.onnx", output, names="{0: 'ailanthus'}"))
    found = detector.detect(picture(96, 192), 5)
    np.testing.assert_allclose(found.boxes_px, [[40, 30, 80, 50]], atol=1e-4)
    np.testing.assert_allclose(found.confidence, [0.9], atol=1e-6)
    assert detector.info.layout is Layout[layout.upper()]
    assert (detector.info.input_px, found.class_names) == ((64, 96), ("ailanthus",))


def test_boxes_in_the_grey_are_left_out(tmp_path):
    detector = Detector(models.constant(tmp_path / "m.onnx", said((50, 3, 10, 4, 0.9, 0)), names="{0: 'a'}"))
    assert len(detector.detect(picture(96, 192), 5)) == 0


def test_confidence_and_overlap_are_settings(tmp_path):
    output = said((30, 28, 20, 10, 0.9, 0), (31, 28, 20, 10, 0.8, 0), (60, 30, 10, 10, 0.2, 0))
    path = models.constant(tmp_path / "m.onnx", output, names="{0: 'a'}")
    assert len(Detector(path, Settings(confidence=0.1)).detect(picture(96, 192), 5)) == 2
    assert len(Detector(path, Settings(iou=0.95)).detect(picture(96, 192), 5)) == 2
    assert len(Detector(path, Settings(confidence=0.1, iou=0.95, most=1)).detect(picture(96, 192), 5)) == 1


def test_the_least_confidence_is_the_one_asked_for_or_the_models_or_the_default(tmp_path):
    output = said((30, 28, 20, 10, 0.9, 0), (60, 30, 10, 10, 0.3, 0), (80, 30, 10, 10, 0.2, 0))
    plain = models.constant(tmp_path / "plain.onnx", output, names="{0: 'a'}")
    advised = models.constant(tmp_path / "advised.onnx", output, names="{0: 'a'}", confidence="0.25")
    for path, asked, least, count in [(plain, 0.0, 0.35, 1), (advised, 0.0, 0.25, 2), (advised, 0.1, 0.1, 3)]:
        detector = Detector(path, Settings(confidence=asked))
        assert (detector.confidence, len(detector.detect(picture(96, 192), 5))) == (least, count)


def test_an_open_input_takes_the_size_of_its_metadata_or_the_default(tmp_path):
    shape = (1, 3, "height", "width")
    path = models.constant(tmp_path / "m.onnx", said(), shape=shape, names="{0: 'a'}", imgsz="[640, 640]")
    detector = Detector(path)
    detector.detect(picture(), 0)
    assert detector._box.blob.shape == (1, 3, 384, 640)
    assert detector.info.input_px is None
    detector = Detector(models.constant(tmp_path / "n.onnx", said(), shape=("batch", *shape[1:]), names="{0: 'a'}"))
    detector.detect(picture(), 0)
    assert detector._box.blob.shape == (1, 3, 480, 832)


def test_half_precision_in_and_out(tmp_path):
    output = said((30, 28, 20, 10, 0.9, 0)).astype(np.float16)
    detector = Detector(models.constant(tmp_path / "m.onnx", output, names="{0: 'a'}"))
    np.testing.assert_allclose(detector.detect(picture(96, 192), 5).boxes_px, [[40, 30, 80, 50]], atol=0.2)


def test_what_it_reports_names_the_model_and_its_content(tmp_path):
    path = models.spotter(tmp_path / "north-slope.onnx", description="for demonstration only")
    info = Detector(path).info
    assert (info.name, info.device) == ("north-slope", "cpu")
    assert info.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert "demonstration" in info.notice
    assert Detector(models.spotter(tmp_path / "real.onnx")).info.notice == ""


def test_weights_in_a_file_beside_the_model_count_for_its_digest(tmp_path):
    path = models.spotter(tmp_path / "m.onnx")
    before = runtime.sha256(path)
    (tmp_path / "m.onnx.data").write_bytes(b"weights")
    assert runtime.sha256(path) != before


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "is empty"),
        (b"PK\x03\x04 and so on", "is a zip archive"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:1\n", "git lfs pull"),
        (b"not a model at all", "expected a complete ONNX file"),
        (bytes(5000), "expected a complete ONNX file"),
    ],
)
def test_other_files_are_refused(tmp_path, content, told):
    path = tmp_path / "model.onnx"
    path.write_bytes(content)
    with pytest.raises(ModelUnreadable, match=told) as caught:
        Detector(path)
    assert str(path) in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ModelUnreadable, match="No such file"):
        Detector(tmp_path / "gone.onnx")


def test_a_truncated_file_is_refused_wherever_it_ends(tmp_path):
    whole = models.spotter(tmp_path / "whole.onnx").read_bytes()
    path = tmp_path / "part.onnx"
    for share in np.linspace(0.02, 0.98, 25):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(DetectionError, match=r"part\.onnx"):
            Detector(path)


@pytest.mark.parametrize(
    ("output", "options", "told"),
    [
        (said(), {"outputs": ("boxes", "labels")}, "outputs boxes, labels, expected one"),
        (said(), {"shape": (1, 64, 96, 3)}, "1 x 64 x 96 x 3 of tensor.float., expected 1 x 3 x height x width"),
        (said(), {"shape": (4, 3, 64, 96)}, "4 x 3 x 64 x 96"),
        (said(), {"shape": (1, 3, 64, "width")}, "one side fixed and one open"),
        (said() - 4.0, {}, "not between 0 and 1"),
        (said((5, 5, -1, 2, 0.5, 0)), {}, "not those of 1 x .4 . classes. x N"),
        (yolov5(), {}, "not those of 1 x N x 6; export a model of YOLOv8 or later"),
        (np.full((1, 50, 6), 7.0, np.float32), {}, "not between 0 and 1"),
        (said() * np.nan, {}, "not between 0 and 1"),
        (said(), {"confidence": "1.5"}, "'confidence' is '1.5', expected a number above 0"),
        (said(), {"task": "pose"}, "task is 'pose'"),
        (said(), {"names": "{0: 'a', 1: 'b'}"}, "1 x 5 x 200 for 2 classes"),
    ],
)
def test_foreign_models_are_refused_with_what_they_have_and_what_is_expected(tmp_path, output, options, told):
    path = models.constant(tmp_path / "foreign.onnx", output, **({"names": "{0: 'a'}"} | options))
    with pytest.raises(ModelForeign, match=told) as caught:
        Detector(path)
    assert str(path) in str(caught.value)


def test_a_class_without_a_name_is_an_error_not_a_guess(tmp_path):
    output = np.zeros((1, 50, 6), np.float32)
    output[0, 0] = [10, 20, 30, 40, 0.9, 3]
    detector = Detector(models.constant(tmp_path / "m.onnx", output, names="{0: 'a'}"))
    with pytest.raises(InferenceFailed, match="class 3 of 1"):
        detector.detect(picture(64, 96), 0)


@pytest.mark.parametrize("image", [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), np.uint8)])
def test_what_is_no_image_is_refused(tmp_path, image):
    with pytest.raises(DetectionError, match="an image is uint8"):
        Detector(models.spotter(tmp_path / "m.onnx")).detect(image, 0)


def test_a_device_that_is_not_there_is_told(tmp_path):
    with pytest.raises(RuntimeMissing, match=r"'tensorrt' was asked for .* only 'cpu'"):
        Detector(models.spotter(tmp_path / "m.onnx"), Settings(device="tensorrt"))


def test_the_fastest_device_comes_first_and_tensorrt_keeps_what_it_built(tmp_path):
    names = ["CPUExecutionProvider", "CUDAExecutionProvider", "TensorrtExecutionProvider"]
    found = runtime._providers(names, "auto", tmp_path / "cache")
    assert [name for name, _ in found] == names[::-1]
    assert found[0][1]["trt_engine_cache_path"] == str(tmp_path / "cache")
    assert found[0][1]["trt_fp16_enable"] == "True"
    assert [name for name, _ in runtime._providers(names, "cuda", None)] == names[1::-1]


def test_without_the_runtime_it_is_said_what_to_install(tmp_path, monkeypatch):
    path = models.spotter(tmp_path / "m.onnx")
    monkeypatch.setitem(importlib.import_module("sys").modules, "onnxruntime", None)
    with pytest.raises(RuntimeMissing, match=r"pip install 'mapforest\[cpu\]'"):
        Detector(path)


def test_what_an_image_costs_is_measured_on_this_machine(tmp_path):
    assert 0.0 < Detector(models.spotter(tmp_path / "m.onnx")).time_s((480, 848)) < 10.0
