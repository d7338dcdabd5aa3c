"""What a driver emits. Stamps are host time: nanoseconds of `CLOCK_MONOTONIC`.

`stamp_ns` is the instant of measurement, mapped from the sensor's clock by `drivers.clock.SensorClock`;
`receive_ns` is the instant the first byte reached the host. The recorder adds the session's UTC anchor once.
Frames: `livox_frame` (x forward, z up) for points, `base_link` (the IMU, axes parallel) for inertial data.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import TypeAlias

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class LidarScan:
    """One 100 ms sweep, no-returns removed.

    xyz_m: (n, 3) float32, `livox_frame`. reflectivity, tag, line: (n,) uint8 as the sensor gave them.
    offset_ns: (n,) uint32, time of each point after `stamp_ns` (the start of the sweep).
    """

    stamp_ns: int
    receive_ns: int
    xyz_m: npt.NDArray[np.float32]
    reflectivity: npt.NDArray[np.uint8]
    tag: npt.NDArray[np.uint8]
    line: npt.NDArray[np.uint8]
    offset_ns: npt.NDArray[np.uint32]


@dataclass(frozen=True, slots=True)
class ImuSample:
    """Angular velocity (rad/s) and specific force (m/s^2) in `base_link`."""

    stamp_ns: int
    receive_ns: int
    angular_velocity: tuple[float, float, float]
    linear_acceleration: tuple[float, float, float]


class FixQuality(IntEnum):
    """GGA field 6. The truth about a fix; RMC's mode letter is not."""

    INVALID = 0
    SINGLE = 1
    DGPS = 2
    PPP = 3
    RTK_FIXED = 4
    RTK_FLOAT = 5
    DEAD_RECKONING = 6
    MANUAL = 7
    SIMULATOR = 8


QUALITY_NAMES: dict[FixQuality, str] = {
    FixQuality.INVALID: "no fix",
    FixQuality.SINGLE: "single",
    FixQuality.DGPS: "DGPS",
    FixQuality.PPP: "PPP",
    FixQuality.RTK_FIXED: "RTK fixed",
    FixQuality.RTK_FLOAT: "RTK float",
    FixQuality.DEAD_RECKONING: "dead reckoning",
    FixQuality.MANUAL: "manual",
    FixQuality.SIMULATOR: "simulator",
}
"""Qualities for people."""


@dataclass(frozen=True, slots=True)
class GnssFix:
    """One GNSS epoch. Position is WGS 84, degrees and metres above the ellipsoid; NaN where there is no fix.

    sigma_enu_m: one-sigma east, north, up. sigma_source says where it is from ("gst", or the stated fallback).
    age_s: age of the differential corrections, None when the receiver gave none.
    utc_ns: the receiver's own UTC epoch, 0 when it did not know the time; date_assumed when no sentence had given the
    date yet.
    """

    stamp_ns: int
    receive_ns: int
    utc_ns: int
    date_assumed: bool
    quality: FixQuality
    latitude_deg: float
    longitude_deg: float
    height_m: float
    geoid_separation_m: float
    satellites: int
    hdop: float
    age_s: float | None
    sigma_enu_m: tuple[float, float, float]
    sigma_source: str
    speed_m_s: float | None = None
    course_deg: float | None = None


@dataclass(frozen=True, slots=True)
class NmeaSentence:
    """One sentence with a valid checksum, as received, without its line end."""

    stamp_ns: int
    receive_ns: int
    sentence: str


@dataclass(frozen=True, slots=True)
class VideoFrame:
    """One H.264 access unit in Annex B, byte for byte as the camera sent it. Frame: `camera`."""

    stamp_ns: int
    receive_ns: int
    data: bytes
    keyframe: bool
    pts_90khz: int


class Severity(Enum):
    """How much an event matters to the operator."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class SensorEvent:
    """Something worth keeping in the file: a reboot, a clock step, a link lost or found."""

    stamp_ns: int
    receive_ns: int
    sensor: str
    severity: Severity
    text: str


Message: TypeAlias = LidarScan | ImuSample | GnssFix | NmeaSentence | VideoFrame | SensorEvent
