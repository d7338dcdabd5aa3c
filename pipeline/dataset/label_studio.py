"""Label Studio's JSON: what people marked in it (both forms of export), and tasks for it.

Shapes are in percent of the image; a rectangle turns clockwise about its upper left corner.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

import msgspec

from pipeline.dataset.errors import DatasetError
from pipeline.dataset.labels import BadLine, Box, bounding

_LABELS = ("rectanglelabels", "polygonlabels", "ellipselabels", "labels")
_ENDINGS = (".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tif", ".tiff")
Corners = tuple[float, float, float, float]


class _Region(msgspec.Struct):
    type: str = ""
    value: dict[str, Any] = {}
    original_width: float | None = None
    original_height: float | None = None


class _Annotation(msgspec.Struct):
    """completed_by: a number, or a table of the person."""

    result: list[_Region] = []
    completed_by: Any = None
    was_cancelled: bool = False
    ground_truth: bool = False
    updated_at: str | None = None
    id: Any = None


class _Task(msgspec.Struct):
    data: dict[str, Any]
    annotations: list[_Annotation] = []
    id: Any = None


@dataclass(frozen=True, slots=True)
class Marked:
    """What one person marked in one image. image: as the task names it. boxes: class names, not numbers.

    problems: what could not be read. ignored: kinds of marks that are no boxes, and how many.
    """

    image: str
    labeler: str
    boxes: tuple[tuple[str, Box], ...]
    problems: tuple[str, ...] = ()
    ignored: tuple[tuple[str, int], ...] = ()
    clipped: int = 0
    polygons: int = 0
    decided: bool = False
    """Set as ground truth among several."""


def read_export(document: bytes, where: str) -> Iterator[Marked]:
    """The last word of each person on each image; nothing for images that nobody has finished. DatasetError."""
    try:
        items = msgspec.json.decode(document, type=list[dict[str, Any]])
    except msgspec.MsgspecError as error:
        raise DatasetError(f"{where}: not an export of Label Studio (a list of tasks): {error}") from error
    for number, item in enumerate(items, 1):
        place = f"{where}: task {item.get('id', number)}"
        try:
            yield from _full(item, place) if "annotations" in item else _short(item, place)
        except msgspec.ValidationError as error:
            raise DatasetError(f"{place}: {error}") from error


def _full(item: dict[str, Any], place: str) -> Iterator[Marked]:
    task = msgspec.convert(item, _Task)
    image = _image(task.data, place)
    latest: dict[str, _Annotation] = {}
    for annotation in sorted(task.annotations, key=lambda one: (one.ground_truth, one.updated_at or "")):
        if not annotation.was_cancelled:
            latest[_person(annotation.completed_by)] = annotation
    for labeler, annotation in latest.items():
        yield _marked(image, labeler, annotation.result, place, decided=annotation.ground_truth)


def _short(item: dict[str, Any], place: str) -> Iterator[Marked]:
    """JSON-MIN: the marks lie beside the image, without the frame around them."""
    marks = [one for value in item.values() if isinstance(value, list) for one in value if isinstance(one, dict)]
    sizes = [(one.get("original_width"), one.get("original_height")) for one in marks]
    regions = [_Region("", one, *size) for one, size in zip(marks, sizes, strict=True)]
    yield _marked(_image(item, place), _person(item.get("annotator")), regions, place, decided=False)


def _marked(image: str, labeler: str, regions: Sequence[_Region], place: str, *, decided: bool) -> Marked:
    boxes: dict[tuple[str, Box], None] = {}
    problems, ignored = [], Counter[str]()
    clipped = polygons = 0
    for region in regions:
        names: list[Any] = next((region.value[key] for key in _LABELS if region.value.get(key)), [])
        try:
            corners = _corners(region)
            if corners is None or not names:
                ignored[region.type or "mark without a label"] += 1
                continue
            box, cut = bounding(0, corners)
        except (BadLine, KeyError, TypeError, ValueError) as why:
            problems.append(f"{place}: {image}: {why if isinstance(why, BadLine) else f'a mark lacks {why}'}")
            continue
        clipped, polygons = clipped + cut, polygons + ("points" in region.value)
        boxes |= dict.fromkeys((str(name), box) for name in names)
    return Marked(
        image, labeler, tuple(boxes), tuple(problems), tuple(sorted(ignored.items())), clipped, polygons, decided
    )


def _corners(region: _Region) -> Corners | None:
    """Shares of the image; None for what has no outline."""
    value = region.value
    if "points" in value:
        across, down = zip(*value["points"], strict=True)
        return _shares(min(across), min(down), max(across), max(down))
    aspect = (region.original_height or 1.0) / (region.original_width or 1.0)
    turn = math.radians(float(value.get("rotation") or 0.0))
    if "radiusX" in value:
        a, b = float(value["radiusX"]), float(value["radiusY"]) * aspect
        half_w = math.hypot(a * math.cos(turn), b * math.sin(turn))
        half_h = math.hypot(a * math.sin(turn), b * math.cos(turn)) / aspect
        return _shares(value["x"] - half_w, value["y"] - half_h, value["x"] + half_w, value["y"] + half_h)
    if "width" not in value:
        return None
    w, h = float(value["width"]), float(value["height"]) * aspect
    cosine, sine = math.cos(turn), math.sin(turn)
    x = [0.0, w * cosine, -h * sine, w * cosine - h * sine]
    y = [0.0, w * sine, h * cosine, w * sine + h * cosine]
    left, top = float(value["x"]), float(value["y"])
    return _shares(left + min(x), top + min(y) / aspect, left + max(x), top + max(y) / aspect)


def _shares(x_min: float, y_min: float, x_max: float, y_max: float) -> Corners:
    return x_min / 100.0, y_min / 100.0, x_max / 100.0, y_max / 100.0


def _image(data: dict[str, Any], place: str) -> str:
    texts = {key: value for key, value in data.items() if isinstance(value, str)}
    named = [value for value in texts.values() if value.partition("&")[0].lower().endswith(_ENDINGS)]
    found = texts.get("image") or (named[0] if named else "")
    if not found:
        raise DatasetError(f"{place}: names no image")
    return found


def _person(who: Any) -> str:
    if isinstance(who, dict):
        return str(who.get("email") or who.get("id") or "")
    return "" if who is None else str(who)


def make_task(
    url: str,
    about: dict[str, Any],
    *,
    size_px: tuple[int, int] = (0, 0),
    boxes: Iterable[Box] = (),
    classes: Sequence[str] = (),
    model: str = "",
) -> dict[str, Any]:
    """One image to label. about: goes along, for the labeler to see. boxes: what `model` suggests."""
    task: dict[str, Any] = {"data": {"image": url, **about}}
    result = [_suggestion(box, size_px, classes) for box in boxes]
    if model:
        score = max((one["score"] for one in result), default=0.0)
        task["predictions"] = [{"model_version": model, "score": score, "result": result}]
    return task


def _suggestion(box: Box, size_px: tuple[int, int], classes: Sequence[str]) -> dict[str, Any]:
    x_min, y_min, _, _ = box.corners
    value = {"x": x_min * 100, "y": y_min * 100, "width": box.w * 100, "height": box.h * 100, "rotation": 0}
    return {
        "from_name": "label",
        "to_name": "image",
        "type": "rectanglelabels",
        "original_width": size_px[0],
        "original_height": size_px[1],
        "image_rotation": 0,
        "score": box.confidence,
        "value": value | {"rectanglelabels": [classes[box.class_id]]},
    }


def label_config(classes: Iterable[str]) -> str:
    """The labelling interface that the tasks are for."""
    labels = "\n".join(f"    <Label value={quoteattr(name)}/>" for name in classes)
    return (
        '<View>\n  <Image name="image" value="$image" zoom="true"/>\n'
        f'  <RectangleLabels name="label" toName="image">\n{labels}\n  </RectangleLabels>\n</View>\n'
    )
