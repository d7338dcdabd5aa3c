"""Detections of a whole session in one file, as msgpack: which model said what of which image."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from edge.errors import FormatError
from pipeline.detections import FrameDetections

DETECTIONS, FACTS = "detections.msgpack", "detection.json"
Box = tuple[float, float, float, float]


class ModelFacts(msgspec.Struct, frozen=True):
    """What made them."""

    name: str
    sha256: str
    class_names: tuple[str, ...]
    device: str
    confidence: float
    iou: float
    demonstration: bool = False


class DetectionFacts(msgspec.Struct):
    """What was looked at. notes: what could not be, and what else has to be said."""

    model: ModelFacts
    images: int = 0
    boxes: int = 0
    seconds: float = 0.0
    """Of work."""
    notes: tuple[str, ...] = ()


class FrameBoxes(msgspec.Struct, frozen=True):
    """One image that was looked at. stamp_ns: of its message. boxes_px: x_min, y_min, x_max, y_max; class_id: into
    `class_names`."""

    stamp_ns: int
    width_px: int
    height_px: int
    boxes_px: tuple[Box, ...] = ()
    confidence: tuple[float, ...] = ()
    class_id: tuple[int, ...] = ()


class DetectionsFile(msgspec.Struct, frozen=True):
    """The whole file. frames: in order of time, those without a box too: absence is evidence."""

    model: ModelFacts
    topic: str
    frames: tuple[FrameBoxes, ...]


def write_detections(path: Path, model: ModelFacts, topic: str, found: Sequence[FrameDetections]) -> None:
    """Stamps stay exact."""
    path.write_bytes(msgspec.msgpack.encode(DetectionsFile(model, topic, tuple(map(_boxes, found)))))


def read_detections(path: Path) -> tuple[ModelFacts, list[FrameDetections]]:
    """FormatError for what is no such file."""
    try:
        held = msgspec.msgpack.decode(path.read_bytes(), type=DetectionsFile)
    except (OSError, msgspec.MsgspecError) as error:
        raise FormatError(f"{path}: not detections of `mapforest process` ({error})") from error
    return held.model, [_detections(one, held.model.class_names) for one in held.frames]


def _boxes(found: FrameDetections) -> FrameBoxes:
    boxes: list[Box] = [tuple(box) for box in found.boxes_px.tolist()]
    scores, classes = tuple(found.confidence.tolist()), tuple(found.class_id.tolist())
    return FrameBoxes(found.stamp_ns, found.width_px, found.height_px, tuple(boxes), scores, classes)


def _detections(held: FrameBoxes, names: tuple[str, ...]) -> FrameDetections:
    return FrameDetections(
        held.stamp_ns,
        held.width_px,
        held.height_px,
        np.array(held.boxes_px, np.float64).reshape(-1, 4),
        np.array(held.confidence, np.float64),
        np.array(held.class_id, np.int64),
        names,
    )
