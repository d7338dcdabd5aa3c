"""LiDAR-inertial odometry: scans and inertial samples in, poses with covariance out."""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from drivers.messages import ImuSample, LidarScan
from pipeline.odometry.cluster_kernels import cluster
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.deskew_kernels import deskew
from pipeline.odometry.filter import Filter, NormalEquations
from pipeline.odometry.initialise import at_rest
from pipeline.odometry.match_kernels import match
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.state import State
from pipeline.odometry.voxel_map import VoxelMap


class LidarInertialOdometry:
    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self._map = VoxelMap(config.map)
        self._imu = []
        self._filter = None
        self._time = 0
        self._slots = np.empty(1 << 16, np.int64)
        self._owners = np.empty(1 << 16, np.int32)
        m = config.match
        self._settings = np.array([m.fewest_points, m.floor_m, m.huber, m.gate])
        self._turn = np.array(config.lidar_to_base)
        self._lever = np.array(config.lidar_in_base_m)
        self.ok = 0

    def offer_imu(self, s):
        self._imu.append(s)

    def process_scan(self, scan):
        end = scan.stamp_ns + 100_000_000
        if self._filter is None:
            rows = np.array([[*s.angular_velocity, *s.linear_acceleration] for s in self._imu if s.stamp_ns <= end])
            if len(rows) < 200:
                return None
            state, cov = at_rest(rows)
            self._filter = Filter(state, cov, self._config.imu, self._config.match)
            self._time = scan.stamp_ns
        used = [s for s in self._imu if s.stamp_ns <= end]
        stamps = np.array([s.stamp_ns for s in self._imu])
        a = np.searchsorted(stamps, self._time, side="right") - 1
        b = np.searchsorted(stamps, end)
        part = self._imu[a:b + 1]
        raw = np.array([[*s.angular_velocity, *s.linear_acceleration] for s in part])
        t = (np.array([s.stamp_ns for s in part]) - scan.stamp_ns) * 1e-9
        t0, t1 = (self._time - scan.stamp_ns) * 1e-9, (end - scan.stamp_ns) * 1e-9
        inner = t[(t > t0) & (t < t1)]
        tt = np.concatenate([[t0], inner, [t1]])
        samples = np.column_stack([tt] + [np.interp(tt, t, raw[:, i]) for i in range(6)])
        self._imu = self._imu[a:]
        knots = self._filter.propagate(samples)
        self._time = end
        r2 = (scan.xyz_m**2).sum(1)
        keep = (r2 > self._config.nearest_m**2) & (r2 < self._config.farthest_m**2) & (scan.tag & 0x0f == 0)
        pts = deskew(scan.xyz_m[keep], scan.offset_ns[keep] * 1e-9, knots, self._turn, self._lever)
        s = self._filter.state
        c = cluster(pts, scan.reflectivity[keep], s.rotation, s.position_m, self._config.match.leaf_m, self._slots, self._owners)
        self.clusters = len(c)
        if len(self._map):
            self.update = self._filter.update(lambda x: self._match(c, x))
        s = self._filter.state
        self._map.insert(c, s.rotation, s.position_m)
        return s

    def _match(self, clusters, guess):
        a, b, n = match(self._map.arrays, clusters, guess.rotation, guess.position_m, self._map.sizes, self._settings)
        scale = min(1.0, self._config.match.effective / max(n[0], 1.0))
        return NormalEquations(a * scale, b * scale, int(n[0]), n[1] / max(n[0], 1), n[2] / max(n[0], 1))
