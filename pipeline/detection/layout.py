"""Which of the layouts of YOLOv8 exports an output has."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from pipeline.detection.card import Card
from pipeline.detection.errors import ModelForeign

BOX = 4
FINAL_FIELDS = 6
_FINEST = 8
"""Stride of the finest of the feature maps; the others double it up to the model's stride."""
_MASKS = 32


class Layout(Enum):
    """What stands where. Boxes are in pixels of the model's input."""

    ROWS = "1 x (4 + classes) x N"
    """cx, cy, w, h, then a score for each class."""
    COLUMNS = "1 x N x (4 + classes)"
    """The same, transposed."""
    FINAL = "1 x N x 6"
    """x_min, y_min, x_max, y_max, score, class: after a suppression inside the model."""


def find_layout(shape: Sequence[int], input_px: tuple[int, int], card: Card) -> tuple[Layout, int]:
    """The layout and the number of classes. input_px: height, width. ModelForeign says what is there instead."""
    if len(shape) != 3 or shape[0] != 1:
        raise ModelForeign(f"its output is {_told(shape)}, expected {_expected()}")
    _, rows, columns = shape
    names = len(card.names)
    if columns == FINAL_FIELDS and _is_final(rows, names, input_px, card):
        if not names:
            raise ModelForeign("it does not name its classes; add metadata 'names', such as \"{0: 'ailanthus'}\"")
        return Layout.FINAL, names
    if not names:
        return (Layout.ROWS if rows < columns else Layout.COLUMNS), _guessed(shape, min(rows, columns) - BOX)
    if BOX + names == rows:
        return Layout.ROWS, names
    if BOX + names == columns:
        return Layout.COLUMNS, names
    raise ModelForeign(f"its output is {_told(shape)} for {names} classes, {_why(rows, columns, names)}")


def _is_final(rows: int, names: int, input_px: tuple[int, int], card: Card) -> bool:
    """Six columns are also the box and scores of two classes: then the number of anchors tells."""
    return card.final or names not in (0, FINAL_FIELDS - BOX) or rows != anchors(input_px, card.stride)


def anchors(input_px: tuple[int, int], stride: int) -> int:
    """Cells of all feature maps: 8400 for 640 x 640."""
    height, width = input_px
    total, step = 0, _FINEST
    while step <= stride:
        total += (height // step) * (width // step)
        step *= 2
    return total


def _guessed(shape: Sequence[int], classes: int) -> int:
    if classes < 1:
        raise ModelForeign(f"its output is {_told(shape)}, expected {_expected()}")
    return classes


def _why(rows: int, columns: int, names: int) -> str:
    if BOX + 1 + names in (rows, columns):
        return "which has an objectness, as YOLOv5 and YOLOX have; export a model of YOLOv8 or later"
    if BOX + names + _MASKS in (rows, columns):
        return "which has masks; export a detection model, not a segmentation model"
    return f"expected {BOX + names} of the two, or 1 x N x 6: {_expected()}"


def _expected() -> str:
    return ", ".join(layout.value for layout in Layout)


def _told(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape)) or "a single number"
