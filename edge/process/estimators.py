"""The estimators of the pipeline as the runners use them, with the geometry of the recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import msgspec
import numpy as np
import numpy.typing as npt

from drivers.messages import GnssFix
from edge.config import Config
from edge.replay.geometry import Geometry
from edge.replay.pairing import Sweep
from pipeline.estimates import GlobalPose, MapToOdom, OdometryEstimate
from pipeline.gnss.config import FusionConfig
from pipeline.odometry.config import OdometryConfig


class Tracked(Protocol):
    """An estimate, with the points (n, 4) of its sweep in `odom`: x, y, z, intensity."""

    @property
    def estimate(self) -> OdometryEstimate: ...
    @property
    def cloud(self) -> npt.NDArray[np.float32]: ...


class Odometry(Protocol):
    """`SweepOdometry`, as far as it is used here."""

    @property
    def note(self) -> str: ...
    def process(self, sweep: Sweep) -> Iterable[Tracked]: ...
    def flush(self) -> Iterable[Tracked]: ...


class Fusion(Protocol):
    """`GnssFusion`, as far as it is used here."""

    def add_odometry(self, estimate: OdometryEstimate) -> None: ...
    def add_fix(self, fix: GnssFix) -> None: ...
    def state(self) -> MapToOdom | None: ...
    def global_pose(self, estimate: OdometryEstimate) -> GlobalPose | None: ...
    @property
    def note(self) -> str: ...


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
    @property
    def notes(self) -> tuple[str, ...]: ...
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
    from edge.process.sweep_odometry import SweepOdometry  # noqa: PLC0415 - numba takes a second
    from pipeline.gnss.fusion import GnssFusion  # noqa: PLC0415
    from pipeline.gnss.smoother import smooth  # noqa: PLC0415

    return Estimators(SweepOdometry, smooth, GnssFusion)


def odometry_config(config: Config, geometry: Geometry) -> OdometryConfig:
    """As configured, with the LiDAR where it is."""
    x, y, z = geometry.lidar[:3, 3].tolist()
    turn = tuple(tuple(row) for row in geometry.lidar[:3, :3].tolist())
    return msgspec.structs.replace(config.odometry, lidar_in_base_m=(x, y, z), lidar_to_base=turn)


def fusion_config(config: Config, geometry: Geometry) -> FusionConfig:
    """As configured, with the antenna where it is."""
    x, y, z = geometry.antenna[:3, 3].tolist()
    return msgspec.structs.replace(config.fusion, antenna_m=(x, y, z))
