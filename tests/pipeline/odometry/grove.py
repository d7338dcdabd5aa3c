"""A cheap world for statistics: level ground and stems, seen without a simulator of beams."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from drivers.messages import ImuSample, LidarScan
from pipeline.odometry.config import ImuConfig, OdometryConfig

EPOCH_NS, SCAN_NS, IMU_NS = 10**12, 100_000_000, 5_000_000
POINTS, REACH_M, RANGE_SIGMA_M, TOP_M, FOOT_M = 2500, 25.0, 0.01, 5.0, -1.4
GRAVITY = np.array([0.0, 0.0, 9.80665])


@dataclass
class Grove:
    """Round and round a small circle among random stems, after a rest; the sensor sits in the IMU.

    Rates and forces carry the noise and the biases that the odometry is configured for.
    """

    seed: int
    seconds: float = 6.0
    stems: int = 60
    imu_config: ImuConfig = field(default_factory=ImuConfig)

    def __post_init__(self):
        self._random = np.random.default_rng(self.seed)
        places = self._random.uniform(-20, 20, (4 * self.stems, 2))
        self._stems = places[np.linalg.norm(places, axis=1) > 4.0][: self.stems]
        self._radii = self._random.uniform(0.05, 0.2, len(self._stems))
        self.config = OdometryConfig(lidar_in_base_m=(0.0, 0.0, 0.0))

    def poses(self, t_s):
        """Positions (n, 3) and rotations of a carrier that sets off smoothly at 1.5 s; any times (n,)."""
        t = np.asarray(t_s, np.float64)
        since = np.maximum(t - 1.5, 0.0)
        angle = 0.5 * (np.sqrt(since**2 + 1.0) - 1.0)
        bob = 0.02 * np.sin(11.0 * since) * (1.0 - np.exp(-since))
        place = np.stack([2.0 * np.sin(angle), 2.0 - 2.0 * np.cos(angle), bob], axis=-1)
        sway = 0.03 * np.sin(5.5 * since) * (1.0 - np.exp(-since))
        return place, Rotation.from_euler("ZYX", np.stack([angle, 0.1 + sway, 0.5 * sway], axis=-1))

    def scans(self):
        """Sweeps, each point at its own time."""
        for k in range(int(self.seconds * 10)):
            offset = np.sort(self._random.integers(0, SCAN_NS, POINTS))
            place, turn = self.poses((k * SCAN_NS + offset) * 1e-9)
            azimuth, level = self._random.uniform(-math.pi, math.pi, POINTS), self._random.uniform(-0.12, 0.9, POINTS)
            body = np.stack([np.cos(azimuth) * np.cos(level), np.sin(azimuth) * np.cos(level), np.sin(level)], axis=1)
            body[: POINTS // 2, 2] *= -1.0  # half of it looks down, at the ground
            distance = self._distance(place, turn.apply(body))
            seen = distance < REACH_M
            xyz = body * (distance + RANGE_SIGMA_M * self._random.standard_normal(POINTS))[:, None]
            octets = np.zeros((3, int(seen.sum())), np.uint8)
            stamp = EPOCH_NS + k * SCAN_NS
            yield LidarScan(
                stamp, stamp + SCAN_NS, xyz[seen].astype(np.float32), *octets, offset[seen].astype(np.uint32)
            )

    def imu(self):
        """Samples by differences of the poses, with noise and walking biases."""
        dt, own = IMU_NS * 1e-9, self.imu_config
        t = np.arange(0, int(self.seconds / dt) + 30) * dt
        step = 1e-4
        (before, turn_before), (here, turn), (after, turn_after) = (self.poses(t + d) for d in (-step, 0.0, step))
        force = turn.inv().apply((after - 2.0 * here + before) / step**2 + GRAVITY)
        rate = (turn_before.inv() * turn_after).as_rotvec() / (2.0 * step)
        white = np.repeat([own.gyro_density_rad_s, own.accel_density_m_s2], 3) / math.sqrt(dt)
        walk = np.repeat([own.gyro_walk_rad_s, own.accel_walk_m_s2], 3) * math.sqrt(dt)
        bias = np.repeat([0.003, 0.05], 3) * self._random.standard_normal(6)
        noise = bias + np.cumsum(walk * self._random.standard_normal((len(t), 6)), axis=0)
        noise += white * self._random.standard_normal((len(t), 6))
        rows = np.column_stack([rate, force]) + noise
        for k, row in enumerate(rows.tolist()):
            stamp = EPOCH_NS + k * IMU_NS
            yield ImuSample(stamp, stamp, tuple(row[:3]), tuple(row[3:]))

    def _distance(self, origin, ray):
        """(n,) to the nearest of ground and stems, infinite where there is none."""
        down = np.minimum(ray[:, 2], -1e-9)
        nearest = np.where(ray[:, 2] < 0.0, (FOOT_M - origin[:, 2]) / down, np.inf)
        flat = np.maximum(np.linalg.norm(ray[:, :2], axis=1), 1e-9)
        for centre, radius in zip(self._stems, self._radii, strict=True):
            to = centre - origin[:, :2]
            along = (to * ray[:, :2]).sum(axis=1) / flat
            aside = np.square(to).sum(axis=1) - along**2
            reach = (along - np.sqrt(np.maximum(radius**2 - aside, 0.0))) / flat
            height = origin[:, 2] + reach * ray[:, 2]
            met = (aside < radius**2) & (along > 0.0) & (height < TOP_M) & (height > FOOT_M)
            nearest = np.where(met & (reach < nearest), reach, nearest)
        return nearest
