"""Boxes in images, from CDR."""

from __future__ import annotations

from dataclasses import dataclass

from edge.ros.cdr import CdrReader

_LEAST_BYTES = 56
"""Of a Detection2D without hypotheses."""
_HYPOTHESIS_BYTES = 8
_POSE = 43
"""Doubles of a PoseWithCovariance."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """vision_msgs/ObjectHypothesis. class_id: in our recordings the name of the class."""

    class_id: str
    score: float


@dataclass(frozen=True, slots=True)
class Detection2D:
    """vision_msgs/Detection2D. box_px: x_min, y_min, x_max, y_max before the turn by theta_rad about its centre."""

    box_px: tuple[float, float, float, float]
    theta_rad: float
    hypotheses: tuple[Hypothesis, ...]
    track: str


@dataclass(frozen=True, slots=True)
class DetectionArray:
    """vision_msgs/Detection2DArray: all of one image."""

    stamp_ns: int
    frame_id: str
    detections: tuple[Detection2D, ...]


def decode_detections(data: bytes | memoryview) -> DetectionArray:
    """vision_msgs/Detection2DArray of ROS 2 Humble and later."""
    reader = CdrReader(data)
    stamp_ns, frame_id = reader.header()
    found = tuple(_detection(reader) for _ in range(reader.length(_LEAST_BYTES)))
    return DetectionArray(stamp_ns, frame_id, found)


def _detection(reader: CdrReader) -> Detection2D:
    reader.header()
    hypotheses = tuple(_hypothesis(reader) for _ in range(reader.length(_HYPOTHESIS_BYTES)))
    x, y, theta, width, height = reader.unpack("d", 5)
    box = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
    return Detection2D(box, theta, hypotheses, reader.string())


def _hypothesis(reader: CdrReader) -> Hypothesis:
    name = reader.string()
    score, *_ = reader.unpack("d", 1 + _POSE)
    return Hypothesis(name, score)
