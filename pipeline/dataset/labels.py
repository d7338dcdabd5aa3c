"""Boxes as YOLO has them: a line `class cx cy w h` each, shares of the image's width and height.

Polygons (`class x1 y1 x2 y2 ...`), as Label Studio mixes in, become their bounding box.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

TOLERANCE = 0.05
"""A hand slips so far over the edge of 0..1; values farther out are in another unit, or the file is broken."""
SMALLEST = 1e-5
"""A side below this is a click, not a box: a tenth of a pixel in the largest photo."""
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Box:
    """Centre and size as shares of the image; it lies within the image. confidence: of a prediction."""

    class_id: int
    cx: float
    cy: float
    w: float
    h: float
    confidence: float = 1.0

    @property
    def corners(self) -> tuple[float, float, float, float]:
        """x_min, y_min, x_max, y_max."""
        return self.cx - self.w / 2, self.cy - self.h / 2, self.cx + self.w / 2, self.cy + self.h / 2


@dataclass(frozen=True, slots=True)
class Labels:
    """Of one image. problems: lines that are no box, as `file:line: why`. The rest counts what was mended."""

    boxes: tuple[Box, ...] = ()
    problems: tuple[str, ...] = ()
    polygons: int = 0
    clipped: int = 0
    repeated: int = 0


class BadLine(ValueError):
    """A line that is no box: why."""


def read_labels(text: str, where: str, classes: int | None = None, *, predictions: bool = False) -> Labels:
    """The boxes of a label file. where: its name, for the problems. classes: how many there are, if it is known.

    predictions: a line may end with a confidence.
    """
    boxes: dict[Box, None] = {}
    problems: list[str] = []
    polygons = clipped = repeated = 0
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words:
            continue
        try:
            box, mended = _box(words, classes, predictions=predictions)
        except BadLine as why:
            problems.append(f"{where}:{number}: {why}")
            continue
        polygons += len(words) > 6
        clipped += mended
        repeated += box in boxes
        boxes[box] = None
    return Labels(tuple(boxes), tuple(problems), polygons, clipped, repeated)


def format_labels(boxes: Iterable[Box], *, predictions: bool = False) -> str:
    """Text of a label file; empty for none: looked at, and nothing is there."""
    return "".join(
        f"{b.class_id} {b.cx:.6f} {b.cy:.6f} {b.w:.6f} {b.h:.6f}" + (f" {b.confidence:.4f}\n" if predictions else "\n")
        for b in boxes
    )


def bounding(class_id: int, corners: tuple[float, float, float, float]) -> tuple[Box, bool]:
    """The box of x_min, y_min, x_max, y_max, cut at the image's edges, and whether it had to be. BadLine."""
    if not all(map(math.isfinite, corners)):
        raise BadLine("a value is not a number")
    inside = tuple(min(max(value, 0.0), 1.0) for value in corners)
    x_min, y_min, x_max, y_max = inside
    if x_max - x_min < SMALLEST or y_max - y_min < SMALLEST:
        raise BadLine("the box has no area in the image; remove it")
    cut = max(abs(a - b) for a, b in zip(inside, corners, strict=True)) > _ROUNDING
    return Box(class_id, (x_min + x_max) / 2, (y_min + y_max) / 2, x_max - x_min, y_max - y_min), cut


def _box(words: list[str], classes: int | None, *, predictions: bool) -> tuple[Box, bool]:
    class_id = _class(words[0], classes)
    values = [_number(word) for word in words[1:]]
    count = len(words)
    if count == 6 and predictions:
        if not 0.0 <= values[4] <= 1.0:
            raise BadLine(f"confidence {words[5]} is not within 0..1")
        box, cut = _centred(class_id, values[:4], words)
        return Box(box.class_id, box.cx, box.cy, box.w, box.h, values[4]), cut
    if count == 5:
        return _centred(class_id, values, words)
    if count >= 7 and count % 2:
        _refuse_far(values, words)
        x, y = values[0::2], values[1::2]
        return bounding(class_id, (min(x), min(y), max(x), max(y)))
    hint = "; six are a prediction with its confidence, not a label" if count == 6 else ""
    raise BadLine(
        f"{count} values; a box has 5 (class cx cy w h), a polygon an odd number from 7 (class x1 y1 x2 y2 ...){hint}"
    )


def _centred(class_id: int, values: list[float], words: list[str]) -> tuple[Box, bool]:
    _refuse_far(values, words)
    cx, cy, w, h = values
    if w < 0 or h < 0:
        raise BadLine("width and height cannot be negative")
    box, cut = bounding(class_id, (cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2))
    # As written where nothing had to be cut: no rounding creeps in.
    return (box, True) if cut else (Box(class_id, cx, cy, w, h), False)


def _refuse_far(values: list[float], words: list[str]) -> None:
    for value, word in zip(values, words[1:], strict=False):
        if not -TOLERANCE <= value <= 1.0 + TOLERANCE:
            unit = "; pixels? YOLO has shares of width and height" if value > 2.0 else ""
            raise BadLine(f"{word} is far outside 0..1{unit}")


def _number(word: str) -> float:
    try:
        value = float(word)
    except ValueError as error:
        raise BadLine(f"{word!r} is not a number") from error
    if not math.isfinite(value):
        raise BadLine(f"{word!r} is not a number")
    return value


def _class(word: str, classes: int | None) -> int:
    value = _number(word)
    if value < 0 or value != int(value):
        raise BadLine(f"class {word!r} is not a row of classes.txt (0, 1, ...)")
    if classes is not None and value >= classes:
        raise BadLine(f"class {word}, but classes.txt has {classes} rows (0 to {classes - 1})")
    return int(value)
