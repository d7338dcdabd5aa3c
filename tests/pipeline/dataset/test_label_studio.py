"""What people marked in Label Studio comes out as boxes; what is put in comes back."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import cv2
import numpy as np
import pytest

from pipeline.dataset.errors import DatasetError
from pipeline.dataset.label_studio import label_config, make_task, read_export
from pipeline.dataset.labels import Box

NAMES = ("ailanthus", "sumac")


def region(value: dict, kind: str = "rectanglelabels", names=("ailanthus",), **fields) -> dict:
    return {
        "type": kind,
        "original_width": 800,
        "original_height": 400,
        "value": value | {kind: list(names)},
        **fields,
    }


def rectangle(x=10.0, y=20.0, width=30.0, height=40.0, rotation=0.0, **fields) -> dict:
    return region({"x": x, "y": y, "width": width, "height": height, "rotation": rotation}, **fields)


def task(*annotations, image="/data/upload/1/ab12cd34-a.jpg", **fields) -> dict:
    return {"id": 7, "data": {"image": image}, "annotations": list(annotations), **fields}


def annotation(*regions, by=1, at="2026-05-01T10:00:00Z", **fields) -> dict:
    return {"id": 1, "completed_by": by, "updated_at": at, "result": list(regions), **fields}


def read(*tasks):
    return list(read_export(json.dumps(list(tasks)).encode(), "export.json"))


def corners(marked):
    return [box.corners for _, box in marked.boxes]


def test_a_rectangle_in_percent_becomes_a_box_in_shares():
    (found,) = read(task(annotation(rectangle())))
    assert found.image.endswith("a.jpg")
    assert found.labeler == "1"
    assert corners(found)[0] == pytest.approx((0.1, 0.2, 0.4, 0.6))


@pytest.mark.parametrize("degrees", [0, 15, 90, 200, 350])
def test_a_turned_rectangle_is_bounded_in_pixels(degrees):
    (found,) = read(task(annotation(rectangle(45, 45, 10, 8, degrees))))
    turn = np.array(cv2.getRotationMatrix2D((360, 180), -degrees, 1.0))  # about its upper left corner, in pixels
    rim = np.array([[360, 180, 1], [440, 180, 1], [440, 212, 1], [360, 212, 1]]) @ turn.T
    expected = np.array([*rim.min(axis=0), *rim.max(axis=0)]) / [800, 400, 800, 400]
    assert corners(found)[0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("degrees", [0, 30, 120])
def test_a_turned_ellipse_is_bounded_in_pixels(degrees):
    value = {"x": 50, "y": 50, "radiusX": 10, "radiusY": 6, "rotation": degrees}
    (found,) = read(task(annotation(region(value, "ellipselabels"))))
    t, turn = np.linspace(0, 2 * np.pi, 7201), np.radians(degrees)
    x = 400 + 80 * np.cos(t) * np.cos(turn) - 24 * np.sin(t) * np.sin(turn)
    y = 200 + 80 * np.cos(t) * np.sin(turn) + 24 * np.sin(t) * np.cos(turn)
    assert corners(found)[0] == pytest.approx((x.min() / 800, y.min() / 400, x.max() / 800, y.max() / 400), abs=1e-5)


def test_polygons_several_labels_and_the_edge():
    polygon = region({"points": [[90, 10], [104, 20], [95, 30]]}, "polygonlabels")
    (found,) = read(task(annotation(polygon, rectangle(names=NAMES))))
    assert corners(found)[0] == pytest.approx((0.9, 0.1, 1.0, 0.3))
    assert [name for name, _ in found.boxes] == ["ailanthus", "ailanthus", "sumac"]
    assert (found.clipped, found.polygons) == (1, 1)


def test_the_last_word_of_each_person_counts_and_skipped_tasks_do_not():
    old, new = annotation(rectangle(), at="2026-05-01"), annotation(rectangle(x=50.0), at="2026-05-02")
    other = annotation(rectangle(), by={"id": 3, "email": "ann@example.org"}, ground_truth=True)
    found = read(task(new, old, other, annotation(rectangle(), by=9, was_cancelled=True)))
    assert [one.labeler for one in found] == ["1", "ann@example.org"]
    assert corners(found[0])[0][0] == pytest.approx(0.5)
    assert [one.decided for one in found] == [False, True]
    assert read(task()) == []
    (nothing_there,) = read(task(annotation()))
    assert nothing_there.boxes == ()


def test_the_short_form_is_read_too():
    mark = {"x": 10, "y": 20, "width": 30, "height": 40, "rotation": 0, "rectanglelabels": ["sumac"]}
    short = {"image": "/data/local-files/?d=walk/a.jpg", "id": 3, "annotator": 1, "label": [mark]}
    (found,) = read(short)
    assert found.boxes[0][0] == "sumac"
    assert corners(found)[0] == pytest.approx((0.1, 0.2, 0.4, 0.6))


def test_marks_that_are_no_boxes_are_counted_and_broken_ones_named():
    brush = region({"rle": [1, 2]}, "brushlabels")
    brush["value"] = {"format": "rle", "rle": [1, 2], "brushlabels": ["ailanthus"]}
    choice = {"type": "choices", "value": {"choices": ["blurred"]}}
    click = rectangle(width=0.0)
    lacking = region({"x": 1, "width": 2, "height": 3})
    (found,) = read(task(annotation(brush, choice, click, lacking, rectangle())))
    assert dict(found.ignored) == {"brushlabels": 1, "choices": 1}
    assert len(found.problems) == 2
    assert all(problem.startswith("export.json: task 7: ") for problem in found.problems)
    assert len(found.boxes) == 1


@pytest.mark.parametrize(
    ("document", "why"),
    [
        (b"{}", "a list of tasks"),
        (b"nonsense", "a list of tasks"),
        (b'[{"id": 4, "data": {}, "annotations": []}]', "task 4: names no image"),
        (b'[{"data": {"image": "a.jpg"}, "annotations": 3}]', "task 1"),
    ],
)
def test_what_is_no_export_is_refused(document, why):
    with pytest.raises(DatasetError, match=f"export.json: .*{why}|{why}"):
        list(read_export(document, "export.json"))


def test_a_suggestion_comes_back_as_the_box_it_was():
    box = Box(1, 0.4, 0.5, 0.2, 0.3, 0.9)
    made = make_task("/data/a.jpg", {"site": "wood"}, size_px=(800, 400), boxes=[box], classes=NAMES, model="m1")
    assert made["data"] == {"image": "/data/a.jpg", "site": "wood"}
    (prediction,) = made["predictions"]
    assert prediction["score"] == 0.9
    (found,) = read({**made, "annotations": [annotation(*prediction["result"])]})
    assert found.boxes[0][0] == "sumac"
    assert corners(found)[0] == pytest.approx(box.corners)
    assert "predictions" not in make_task("/data/a.jpg", {})


def test_the_labelling_interface_fits_the_suggestions():
    view = ET.fromstring(label_config(['tree "of" heaven', "a<b"]))
    labels = view.find("RectangleLabels")
    assert (labels.get("name"), labels.get("toName")) == ("label", view.find("Image").get("name"))
    assert [label.get("value") for label in labels] == ['tree "of" heaven', "a<b"]
