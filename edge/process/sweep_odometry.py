"""The odometry by sweeps: what it says of each as an `OdometryEstimate`, with the sweep's points in `odom`."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.messages import LidarScan
from edge.replay.pairing import Sweep, end_of
from pipeline.estimates import OdometryEstimate
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.estimate import Odometry, Status
from pipeline.odometry.odometry import LidarInertialOdometry

_POSITION_FIRST = [3, 4, 5, 0, 1, 2]
_STRIDE_M = 0.05
"""Travelled way is counted in strides of at least this: standing still adds nothing."""


@dataclass(frozen=True, slots=True)
class Tracked:
    """cloud: (n, 4) float32, x, y, z in `odom` and intensity, of the sweep that ends at the estimate."""

    estimate: OdometryEstimate
    cloud: npt.NDArray[np.float32]


class SweepOdometry:
    """`LidarInertialOdometry`, fed with sweeps. One that starts in motion holds the first ones back."""

    def __init__(self, config: OdometryConfig) -> None:
        self._odometry = LidarInertialOdometry(config)
        self._scans: deque[LidarScan] = deque()
        self._travelled_m = 0.0
        self._stood_m: npt.NDArray[np.float64] | None = None

    @property
    def note(self) -> str:
        """Why the last sweep brought no estimate, empty when it did."""
        return self._odometry.refusal

    def process(self, sweep: Sweep) -> Iterator[Tracked]:
        """The estimates that became possible, in order of time."""
        for sample in sweep.imu:
            self._odometry.offer_imu(sample)
        self._odometry.offer_scan(sweep.scan)
        self._scans.append(sweep.scan)
        yield from map(self._tracked, self._odometry.take())

    def flush(self) -> Iterator[Tracked]:
        """Of what was held back: nothing more will come."""
        yield from map(self._tracked, self._odometry.take(flush=True))

    def _tracked(self, found: Odometry) -> Tracked:
        while len(self._scans) > 1 and end_of(self._scans[0]) < found.stamp_ns:
            self._scans.popleft()
        if found.gap_s or found.status is Status.COASTING:  # where its points are is a guess: not for the map
            return Tracked(self._estimate(found), np.empty((0, 4), np.float32))
        scan = self._scans[0]
        world = found.cloud.xyz_m @ found.rotation.T + found.position_m
        cloud = np.column_stack([world, scan.reflectivity[found.cloud.index]]).astype(np.float32)
        return Tracked(self._estimate(found), cloud)

    def _estimate(self, found: Odometry) -> OdometryEstimate:
        if self._stood_m is None:
            self._stood_m = found.position_m
        stride_m = float(np.linalg.norm(found.position_m - self._stood_m))
        if stride_m > _STRIDE_M:
            self._travelled_m += stride_m
            self._stood_m = found.position_m
        return OdometryEstimate(
            stamp_ns=found.stamp_ns,
            position_m=found.position_m,
            rotation=found.rotation,
            velocity_m_s=found.velocity_m_s,
            covariance=found.covariance[np.ix_(_POSITION_FIRST, _POSITION_FIRST)],
            gyro_bias=found.gyro_bias,
            accel_bias=found.accel_bias,
            travelled_m=self._travelled_m,
            degenerate=found.status in (Status.DEGENERATE, Status.DOUBTFUL, Status.COASTING),
            weak_directions=found.weak_position,
            points=found.residuals.clusters,
            matches=found.residuals.matches,
            note=found.note,
        )
