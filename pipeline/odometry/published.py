"""What is published of a state: level, and with the drift of the map in its covariance."""

from __future__ import annotations

import numpy as np

from pipeline.odometry.drift import Drift
from pipeline.odometry.estimate import Odometry, Status
from pipeline.odometry.filter import Filter
from pipeline.odometry.state import GRAVITY, gravity_axes
from pipeline.odometry.tracker import Registration
from pipeline.odometry.upright import Upright


def published(
    stamp_ns: int,
    status: Status,
    filter_: Filter,
    found: Registration,
    *,
    upright: Upright,
    drift: Drift,
    saturated: bool,
    gap_s: float,
    note: str,
) -> Odometry:
    """The filter's state after a scan, in `odom`."""
    state, covariance, turn = filter_.state, filter_.covariance, upright.turn
    rotation = turn @ state.rotation
    spin = np.eye(9)
    spin[3:6, 3:6] = spin[6:9, 6:9] = turn
    whole = spin @ covariance[:9, :9] @ spin.T
    in_map = whole[:6, :6].copy()
    tilt = state.rotation.T @ gravity_axes(state.gravity_m_s2)
    whole[:3, :3] += tilt @ covariance[GRAVITY, GRAVITY] @ tilt.T
    whole[:6, :6] = drift.add_to(whole[:6, :6], rotation)
    return Odometry(
        stamp_ns,
        status,
        rotation,
        upright.position(state),
        turn @ state.velocity_m_s,
        state.gyro_bias,
        state.accel_bias,
        whole,
        in_map,
        found.weak_attitude,
        found.weak_position @ turn.T,
        found.residuals,
        found.cloud,
        saturated,
        gap_s,
        note,
    )
