"""The estimators of the pipeline as the runners use them, with the geometry of the recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import msgspec
import numpy as np
import numpy.typing as npt

from drivers.messages import GnssFix, ImuSample, LidarScan
from edge.config import Config
from edge.replay.geometry import Geometry
from pipeline.estimates import GlobalPose, MapToOdom, OdometryEstimate
from pipeline.gnss.config import FusionConfig
from pipeline.odometry.config import OdometryConfig


class Odometry(Protocol):
    """`LidarInertialOdometry`, as far as it is used here."""

    def process_scan(self, scan: LidarScan, imu: Sequence[ImuSample]) -> OdometryEstimate | None: ...
    def cloud(self) -> npt.NDArray[np.float32]: ...


class Fusion(Protocol):
    """`GnssFusion`, as far as it is used here."""

    def add_odometry(self, estimate: OdometryEstimate) -> None: ...
    def add_fix(self, fix: GnssFix) -> None: ...
    def state(self) -> MapToOdom | None: ...
    def global_pose(self, estimate: OdometryEstimate) -> GlobalPose | None: ...


class Datum(Protocol):
    """Origin of `map`."""

    @property
    def latitude_deg(self) -> float: ...
    @property
    def longitude_deg(self) -> float: ...
    @property
    def height_m(self) -> float: ...


class Drift(Protocol):
    """`SmoothedDrift`, as far as it is used here."""

    @property
    def datum(self) -> Datum: ...
    def pose(self, estimate: OdometryEstimate) -> GlobalPose: ...


Smooth = Callable[[Iterable[OdometryEstimate], Iterable[GnssFix], FusionConfig], Drift | None]


@dataclass(frozen=True, slots=True)
class Estimators:
    """How to build and call them. Tests give others."""

    odometry: Callable[[OdometryConfig], Odometry]
    smooth: Smooth
    """For a whole session, afterwards."""
    fusion: Callable[[FusionConfig], Fusion]
    """As it goes."""


def estimators() -> Estimators:
    """The real ones; loads the compiled kernels."""
    from pipeline.gnss.fusion import GnssFusion  # noqa: PLC0415
    from pipeline.gnss.smoother import smooth  # noqa: PLC0415 - numba takes a second
    from pipeline.odometry.odometry import LidarInertialOdometry  # noqa: PLC0415

    return Estimators(LidarInertialOdometry, smooth, GnssFusion)


def odometry_config(config: Config, geometry: Geometry) -> OdometryConfig:
    """As configured, with the LiDAR where it is."""
    x, y, z = geometry.lidar[:3, 3].tolist()
    turn = tuple(tuple(row) for row in geometry.lidar[:3, :3].tolist())
    return msgspec.structs.replace(config.odometry, lidar_in_base_m=(x, y, z), lidar_to_base=turn)


def fusion_config(config: Config, geometry: Geometry) -> FusionConfig:
    """As configured, with the antenna where it is."""
    x, y, z = geometry.antenna[:3, 3].tolist()
    return msgspec.structs.replace(config.fusion, antenna_m=(x, y, z))
