"""What the odometry says after each scan."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from pipeline.odometry.so3 import Doubles


class Status(Enum):
    """How far an estimate is to be trusted."""

    TRACKING = "tracking"
    DEGENERATE = "degenerate"
    """The scan left a direction open; the inertial sensor carries it."""
    DOUBTFUL = "doubtful"
    """Scan and inertial samples contradict each other; the samples were doubted, and the scan was followed."""
    COASTING = "coasting"
    """No scan, or none that fits the map: inertial only."""
    RESTARTED = "restarted"
    """The first estimate after a break; the way across it is a guess, and its covariance says so."""


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Of the last iteration. clusters: of the scan; matches: those that met a voxel; squared: mean d^2 of these.

    surprise: normalised square of what the scan moved the inertial prediction by, six degrees of freedom.
    """

    points: int
    clusters: int
    matches: int
    squared: float
    kept: float
    iterations: int
    surprise: float


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """The scan at its end: xyz_m (n, 3) float32 in `base_link`, each point moved by the motion since its own time.

    index: (n,) of the points in the scan as it came.
    """

    xyz_m: npt.NDArray[np.float32]
    index: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Odometry:
    """`base_link` in `odom` at the end of a scan. `odom` starts level, with the first heading along x.

    rotation (3, 3); position, velocity, biases (3,), SI. covariance (9, 9): attitude (rad, body axes), position,
    velocity (`odom` axes), of the whole way since the start. covariance_in_map (6, 6): against the map at hand only.
    weak_attitude, weak_position: (k, 3) rows, directions that this scan did not show (body and `odom` axes).
    """

    stamp_ns: int
    status: Status
    rotation: Doubles
    position_m: Doubles
    velocity_m_s: Doubles
    gyro_bias: Doubles
    accel_bias: Doubles
    covariance: Doubles
    covariance_in_map: Doubles
    weak_attitude: Doubles
    weak_position: Doubles
    residuals: Residuals
    cloud: Cloud
    saturated: bool
    """The inertial sensor reached its range during this scan."""
    gap_s: float
    """Longest silence of the inertial sensor within this scan, beyond which motion was guessed."""
    note: str = ""
    """What happened, for the operator; empty when nothing did."""
