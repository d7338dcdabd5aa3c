"""`mapforest evaluate detection`, with a model and with what another program found."""

from __future__ import annotations

import importlib
import json

import cv2
import numpy as np
import pytest

from edge.cli.main import main
from tests.pipeline.evaluation import labels

NAMES = ("red", "blue")


@pytest.fixture
def dataset(tmp_path):
    """Two images with a red square each, one of which is blue in truth."""
    truth = {
        "here/a": labels.boxes([(0, 0.2, 1 / 3, 0.4, 2 / 3)]),
        "here/b": labels.boxes([(1, 0.2, 1 / 3, 0.4, 2 / 3)]),
    }
    labels.write(tmp_path / "data", truth, NAMES, {"here/a": "trail", "here/b": "meadow"}, images=False)
    for name in truth:
        image = np.full((96, 160, 3), 90, np.uint8)
        image[32:64, 32:64] = (0, 0, 255)
        path = tmp_path / "data" / "images" / f"{name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), image)
    return tmp_path / "data"


@pytest.fixture
def model(tmp_path):
    pytest.importorskip("onnxruntime", reason="the detector's runtime is an extra")
    pytest.importorskip("onnx", reason="models for tests are built with onnx")
    return importlib.import_module("tests.pipeline.detection.models").spotter(tmp_path / "spot.onnx", (96, 160), NAMES)


def test_a_model_is_asked_and_judged(dataset, model, tmp_path, capsys):
    page, worst = tmp_path / "curves.html", tmp_path / "worst.jpg"
    command = ["evaluate", "detection", str(model), str(dataset), "--page", str(page), "--worst", str(worst)]
    assert main([*command, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["confusion"] == [[1, 0, 0], [1, 0, 0], [0, 0, 0]]
    assert told["overall"]["hits"] == 1
    assert told["classes"]["red"]["ap50"] == 1.0
    assert told["sites"]["meadow"]["recall"] == 0.0
    assert "<svg" in page.read_text()
    assert cv2.imread(str(worst)) is not None
    assert main(command) == 0
    out = capsys.readouterr().out
    assert "the 1 worst of 1 images with an error" in out
    assert "rows: what is there; columns: what was said of it" in out


def test_the_confidence_of_the_operating_point_can_be_moved(dataset, model, capsys):
    assert main(["evaluate", "detection", str(model), str(dataset), "--json", "--confidence", "1.0"]) == 0
    assert json.loads(capsys.readouterr().out)["overall"]["found"] == 0


def test_what_another_program_found_is_judged_alike(dataset, tmp_path, capsys):
    (tmp_path / "runs" / "here").mkdir(parents=True)
    (tmp_path / "runs" / "here" / "a.txt").write_text("0 0.3 0.5 0.2 0.34 0.8\n")
    assert main(["evaluate", "detection", str(tmp_path / "runs"), str(dataset), "--json"]) == 0
    overall = json.loads(capsys.readouterr().out)["overall"]
    assert (overall["found"], overall["hits"], overall["recall"]) == (1, 1, 0.5)


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["detection", "m.onnx"], 2, "a dataset is missing"),
        (["detection", "m.onnx", "nowhere"], 1, "nowhere: no such folder"),
        (["trajectory", "session"], 2, "give one session, and its truth with --truth"),
        (["clocks", "session", "other", "--truth", "t"], 2, "give one session"),
    ],
)
def test_wrong_use_is_told(arguments, code, told, capsys):
    assert main(["evaluate", *arguments]) == code
    assert told in capsys.readouterr().err


def test_a_page_that_cannot_be_written_is_told(dataset, model, tmp_path, capsys):
    command = ["evaluate", "detection", str(model), str(dataset)]
    assert main([*command, "--page", str(tmp_path / "gone" / "page.html")]) == 1
    assert "cannot be written" in capsys.readouterr().err
    assert main([*command, "--worst", str(tmp_path / "worst.xyz")]) == 2
    assert "pictures end in .jpg" in capsys.readouterr().err
