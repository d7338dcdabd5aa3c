"""Our odometry over one walk, in a process of its own, so that its time and memory are its own.

python -m benchmarks.odometry.run_ours FOLDER OUTPUT.npz
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.odometry.simulated import SCAN_NS, Walk
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.estimate import Odometry
from pipeline.odometry.odometry import LidarInertialOdometry


def run(walk: Walk, config: OdometryConfig) -> Iterator[tuple[Odometry, float]]:
    """Each estimate with the ms of processor time it took; samples come in step with the scans."""
    odometry, imu, used = LidarInertialOdometry(config), walk.imu(), 0
    for scan in walk.scans():
        while used < len(imu) and imu[used].stamp_ns <= scan.stamp_ns + SCAN_NS:
            odometry.offer_imu(imu[used])
            used += 1
        begun = time.process_time()
        odometry.offer_scan(scan)
        estimates = list(odometry.take())
        took = 1e3 * (time.process_time() - begun)
        for estimate in estimates:
            yield estimate, took / len(estimates)


def main() -> None:
    walk, target = Walk(Path(sys.argv[1])), sys.argv[2]
    list(zip(range(15), run(walk, OdometryConfig()), strict=False))  # compiled kernels are loaded before the clock runs
    found = list(run(walk, OdometryConfig()))
    estimates = [estimate for estimate, _ in found]
    np.savez(
        target,
        stamp_ns=[e.stamp_ns for e in estimates],
        position=[e.position_m for e in estimates],
        rotation=[e.rotation for e in estimates],
        covariance=[e.covariance for e in estimates],
        in_map=[e.covariance_in_map for e in estimates],
        velocity=[e.velocity_m_s for e in estimates],
        status=[e.status.value for e in estimates],
        squared=[e.residuals.squared for e in estimates],
        ms=[took for _, took in found],
        peak_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        failed="",
    )


if __name__ == "__main__":
    main()
