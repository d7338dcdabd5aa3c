"""Every compiled kernel loaded before there is anything to miss: seconds, and a minute the first time on a machine."""

from __future__ import annotations

import numpy as np

from drivers.messages import ImuSample, LidarScan
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.odometry import LidarInertialOdometry
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.start import SWEEP_NS
from pipeline.odometry.state import GRAVITY_M_S2

SCANS, SAMPLES = 25, 20
POINTS = 3000
SWAY_RAD_S = 0.2
"""Enough not to be taken for rest, so that the other way to begin is gone as well."""


def warm_up(config: OdometryConfig) -> None:
    """Stand in a made-up room for two seconds, then sway in it."""
    room = _room()
    for sway_rad_s in (0.0, SWAY_RAD_S):
        odometry = LidarInertialOdometry(config)
        for k in range(SCANS):
            begin_ns = (k + 1) * SWEEP_NS
            for i in range(SAMPLES):
                stamp_ns = begin_ns + i * SWEEP_NS // SAMPLES
                rate = sway_rad_s * (-1.0) ** i
                odometry.offer_imu(ImuSample(stamp_ns, stamp_ns, (rate, rate, rate), (0.0, 0.0, GRAVITY_M_S2)))
            odometry.offer_scan(_scan(room, begin_ns))
            for _ in odometry.take():
                pass


def _room() -> Doubles:
    """Points (n, 3) on the six walls of a room of 10 x 10 x 4 m around the sensor."""
    noise = np.random.default_rng(1)
    points = noise.uniform(-1.0, 1.0, (POINTS, 3))
    points[np.arange(POINTS), noise.integers(0, 3, POINTS)] = noise.choice([-1.0, 1.0], POINTS)
    return points * [5.0, 5.0, 2.0]


def _scan(room: Doubles, begin_ns: int) -> LidarScan:
    zeros = np.zeros(len(room), np.uint8)
    offsets = np.linspace(0, SWEEP_NS - 1, len(room)).astype(np.uint32)
    return LidarScan(begin_ns, begin_ns, room.astype(np.float32), zeros, zeros, zeros, offsets)
