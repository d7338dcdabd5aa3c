"""What the recorder itself adds to a recording. Stamps are host time, as in `drivers.messages`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

from drivers.messages import Message
from edge.ros.frames import Transform


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, slots=True)
class DiagnosticStatus:
    """State of one part: a sensor, its clock, the disk, the queue. `values` are (key, value) pairs."""

    name: str
    level: Level
    message: str = ""
    hardware_id: str = ""
    values: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Diagnostics:
    """The state of everything at one instant, about once a second."""

    stamp_ns: int
    receive_ns: int
    statuses: tuple[DiagnosticStatus, ...]


@dataclass(frozen=True, slots=True)
class Mark:
    """The operator's note: something is here."""

    stamp_ns: int
    receive_ns: int
    text: str


Covariance: TypeAlias = tuple[float, ...]
"""36 numbers, row by row: x, y, z (m), then rotation about the fixed axes x, y, z (rad), as ROS has it."""


@dataclass(frozen=True, slots=True)
class OdometryPose:
    """`base_link` in `odom`, from the live pipeline. velocity_m_s, angular_velocity: in `base_link`."""

    stamp_ns: int
    receive_ns: int
    position_m: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float]
    covariance: Covariance
    velocity_m_s: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class GnssPose:
    """`base_link` in `map` (ENU at the datum), from the live pipeline."""

    stamp_ns: int
    receive_ns: int
    position_m: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float]
    covariance: Covariance


@dataclass(frozen=True, slots=True)
class Transforms:
    """What `/tf` says at one instant."""

    stamp_ns: int
    receive_ns: int
    transforms: tuple[Transform, ...]


@dataclass(frozen=True, slots=True)
class DetectedBox:
    """box_px: x_min, y_min, x_max, y_max in the image as the camera sent it. confidence: 0..1."""

    box_px: tuple[float, float, float, float]
    confidence: float
    class_name: str


@dataclass(frozen=True, slots=True)
class Detections:
    """What stands in one image, from the live pipeline; also that nothing does. stamp_ns: the image's own."""

    stamp_ns: int
    receive_ns: int
    boxes: tuple[DetectedBox, ...]


Recordable: TypeAlias = Message | Diagnostics | Mark | OdometryPose | GnssPose | Transforms | Detections
"""Everything that can be offered to a recording."""
