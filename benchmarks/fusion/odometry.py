"""Odometry as a good LiDAR-inertial one drifts, without the LiDAR: true motion, distorted as it goes.

Errors are correlated along the way: a Gauss-Markov share of the velocity and a random walk of the yaw.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.sim.trajectory import Trajectory
from pipeline.estimates import Array, OdometryEstimate

PERIOD_NS = 100_000_000


@dataclass(frozen=True, slots=True)
class Drift:
    """share: standard deviation of the velocity error as a share of the speed, lasting for `lasting_m`."""

    share: float = 0.01
    lasting_m: float = 20.0
    yaw_deg: float = 0.05
    """Random walk, after one metre."""


@dataclass(frozen=True, slots=True)
class Odometry:
    """Estimates at 10 Hz, in an `odom` at the start of the walk with yaw 0 there.

    truth_m: (n, 3) of `base_link` in the world. alone_m: (n,) error without GNSS, given the true pose at the start.
    """

    estimates: list[OdometryEstimate]
    truth_m: Array
    alone_m: Array

    @property
    def end_error_m(self) -> float:
        """What has drifted in the end."""
        return float(self.alone_m[-1])


def drifted(trajectory: Trajectory, drift: Drift, seed: int) -> Odometry:
    """The odometry of a whole walk."""
    random = np.random.default_rng((seed, 77))
    stamps = np.arange(0, trajectory.duration_ns + 1, PERIOD_NS)
    truth, rotations = trajectory.poses(stamps)
    yaw0 = math.atan2(rotations[0, 1, 0], rotations[0, 0, 0])
    steps = np.diff(truth, axis=0)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
    length = np.diff(way)
    turn = -yaw0 + np.cumsum(math.radians(drift.yaw_deg) * np.sqrt(length) * random.standard_normal(len(length)))
    turn = np.concatenate([[-yaw0], turn])
    error = _lasting(length, drift, random)
    moved = steps + error * length[:, None]
    odom = np.concatenate([np.zeros((1, 3)), np.cumsum(_turned(turn[:-1], moved), axis=0)])
    estimates = [
        OdometryEstimate(
            stamp_ns=int(stamp),
            position_m=odom[k],
            rotation=_turns(turn[k]) @ rotations[k],
            velocity_m_s=np.zeros(3),
            covariance=np.diag([0.02] * 3 + [0.002] * 3) ** 2,
            gyro_bias=np.zeros(3),
            accel_bias=np.zeros(3),
            travelled_m=float(way[k]),
            degenerate=False,
            weak_directions=np.zeros((0, 3)),
            points=2000,
            matches=1500,
        )
        for k, stamp in enumerate(stamps)
    ]
    alone = odom @ _turns(yaw0).T + truth[0] - truth
    return Odometry(estimates, truth, np.linalg.norm(alone, axis=1))


def _lasting(length_m: Array, drift: Drift, random: np.random.Generator) -> Array:
    """(n, 3) velocity error as a share of the speed."""
    error = np.empty((len(length_m), 3))
    now = drift.share * random.standard_normal(3)
    for k, step in enumerate(length_m):
        keep = math.exp(-step / drift.lasting_m)
        now = keep * now + drift.share * math.sqrt(1.0 - keep**2) * random.standard_normal(3)
        error[k] = now
    return error


def _turns(yaw: float) -> Array:
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _turned(yaw: Array, vectors: Array) -> Array:
    cosine, sine = np.cos(yaw), np.sin(yaw)
    x, y, z = vectors.T
    return np.column_stack([cosine * x - sine * y, sine * x + cosine * y, z])
