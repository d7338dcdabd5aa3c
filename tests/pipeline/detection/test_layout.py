"""What models say of themselves, and which outputs are known."""

from __future__ import annotations

import pytest

from pipeline.detection.card import Card, read_card
from pipeline.detection.errors import ModelForeign
from pipeline.detection.layout import Layout, anchors, find_layout

INPUT = (640, 640)
ONE, TWO, EIGHTY = Card(("a",)), Card(("a", "b")), Card(tuple(map(str, range(80))))


@pytest.mark.parametrize(
    ("shape", "card", "layout", "classes"),
    [
        ((1, 5, 8400), ONE, Layout.ROWS, 1),
        ((1, 8400, 5), ONE, Layout.COLUMNS, 1),
        ((1, 84, 8400), EIGHTY, Layout.ROWS, 80),
        ((1, 300, 6), ONE, Layout.FINAL, 1),
        ((1, 300, 6), EIGHTY, Layout.FINAL, 80),
        ((1, 6, 8400), TWO, Layout.ROWS, 2),
        ((1, 300, 6), TWO, Layout.FINAL, 2),
        ((1, 8400, 6), TWO, Layout.COLUMNS, 2),
        ((1, 8400, 6), Card(("a", "b"), final=True), Layout.FINAL, 2),
        ((1, 5, 8400), Card(), Layout.ROWS, 1),
        ((1, 8400, 6), Card(), Layout.COLUMNS, 2),
    ],
)
def test_each_layout_is_known_by_its_shape(shape, card, layout, classes):
    assert find_layout(shape, INPUT, card) == (layout, classes)


@pytest.mark.parametrize(
    ("shape", "card", "told"),
    [
        ((1, 25200, 6), ONE, None),
        ((1, 25200, 85), EIGHTY, "objectness, as YOLOv5"),
        ((1, 116, 8400), EIGHTY, "masks"),
        ((1, 5, 8400), EIGHTY, "1 x 5 x 8400 for 80 classes, expected 84"),
        ((1, 8400), ONE, "1 x 8400, expected 1 x"),
        ((2, 5, 8400), ONE, "2 x 5 x 8400, expected 1 x"),
        ((1, 300, 6), Card(), "does not name its classes"),
        ((1, 4, 8400), Card(), "1 x 4 x 8400, expected 1 x"),
    ],
)
def test_what_is_foreign_is_told_with_what_is_expected(shape, card, told):
    if told is None:  # of one class, YOLOv5's six fields look like final boxes: its numbers give it away
        assert find_layout(shape, INPUT, card)[0] is Layout.FINAL
        return
    with pytest.raises(ModelForeign, match=told):
        find_layout(shape, INPUT, card)


def test_anchors_are_those_of_the_published_inputs():
    assert anchors((640, 640), 32) == 8400
    assert anchors((832, 832), 32) == 14196
    assert anchors((1280, 1280), 64) == 34000


def test_metadata_are_read_as_ultralytics_writes_them():
    card = read_card(
        {
            "names": "{0: 'Ailanthus altissima', 1: 'Rhus typhina'}",
            "imgsz": "[480, 832]",
            "stride": "32",
            "task": "detect",
            "args": "{'batch': 1, 'half': False, 'nms': True}",
            "description": "For demonstration",
        }
    )
    assert card == Card(("Ailanthus altissima", "Rhus typhina"), (480, 832), 32, final=True, demonstration=True)
    assert read_card({}) == Card()
    assert read_card({"names": "['a', 'b']", "imgsz": "640"}) == Card(("a", "b"), (640, 640))


@pytest.mark.parametrize(
    ("metadata", "told"),
    [
        ({"names": "__import__('os').getcwd()"}, "'names' is .* expected a Python literal"),
        ({"names": "{1: 'a'}"}, "'names' is .* expected a dictionary of class numbers from 0"),
        ({"names": "{}"}, "'names'"),
        ({"imgsz": "[640]"}, "'imgsz'"),
        ({"stride": "'x'"}, "'stride'"),
        ({"task": "segment"}, "task is 'segment', expected 'detect'"),
    ],
)
def test_metadata_that_make_no_sense_are_told(metadata, told):
    with pytest.raises(ModelForeign, match=told):
        read_card(metadata)
