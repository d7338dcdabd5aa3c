"""What an emulator asks of the simulated world. Each source is one sensor's view of the same walk.

`t_ns` is walk time: nanoseconds since the payload was switched on in the simulation, the same for all sensors.
The carrier stands still at first. The emulators add what belongs to the device: its clock, its packets, its faults.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class PointBlock:
    """Consecutive point slots of the Mid-360, 5 us apart, no-returns kept as zeros.

    xyz_mm: (n, 3) int32 in `livox_frame`. reflectivity, tag: (n,) uint8.
    """

    xyz_mm: npt.NDArray[np.int32]
    reflectivity: npt.NDArray[np.uint8]
    tag: npt.NDArray[np.uint8]


class LidarSource(Protocol):
    """Casts the laser."""

    def cast(self, t_ns: int, count: int) -> PointBlock:
        """`count` point slots, the first at `t_ns`, each cast from the pose at its own time."""


class ImuSource(Protocol):
    """Reads the accelerometer and gyro. Called with increasing times: the biases walk."""

    def sample(self, t_ns: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Angular velocity (rad/s) and specific force (g), as the device reports them."""


@dataclass(frozen=True, slots=True)
class GnssEpoch:
    """What the receiver would report. quality 0: no fix, and position and sigmas are NaN."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    geoid_separation_m: float
    quality: int
    satellites: int
    hdop: float
    age_s: float | None
    sigma_enu_m: tuple[float, float, float]
    speed_m_s: float
    course_deg: float


class GnssSource(Protocol):
    """Solves a position. Called with increasing times: the errors are correlated."""

    def epoch(self, t_ns: int) -> GnssEpoch | None:
        """None when the receiver says nothing at all."""


class VideoSource(Protocol):
    """Films. Frame k is exposed at k * 1001/30000 s of walk time; called with increasing k, which leaves out
    what could not be filmed in time."""

    def access_unit(self, index: int) -> tuple[bytes, bool]:
        """H.264 access unit in Annex B, and whether it is a keyframe (then SPS and PPS are in it)."""


@dataclass(frozen=True, slots=True)
class Sources:
    """One seeded world as seen by all sensors."""

    lidar: LidarSource
    imu: ImuSource
    gnss: GnssSource
    video: VideoSource


class StopFlag(Protocol):
    """Event of `threading` or `multiprocessing` that ends an emulator."""

    def is_set(self) -> bool:
        """Whether to stop."""

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is set, `timeout` seconds at most; whether it is."""
