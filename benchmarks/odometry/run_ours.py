"""Our odometry over one walk, in a process of its own, so that its time and memory are its own.

python -m benchmarks.odometry.run_ours FOLDER OUTPUT.npz [FIRST_S]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

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


def peak_mb() -> float:
    """Most memory this process has had. Not `getrusage`: that remembers the parent's size from before the exec."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split("VmHWM:")[1].split()[0]) / 1024.0


def main() -> None:
    folder, target, *first_s = sys.argv[1:]
    walk = Walk(Path(folder), *(int(value) for value in first_s))
    list(zip(range(15), run(walk, OdometryConfig()), strict=False))  # compiled kernels are loaded before the clock runs
    rows = [_row(estimate, took) for estimate, took in run(walk, OdometryConfig())]
    np.savez(target, peak_mb=peak_mb(), failed="", **{name: [row[name] for row in rows] for name in rows[0]})


def _row(estimate: Odometry, took: float) -> dict[str, Any]:
    """What is kept of an estimate: its points are not."""
    return {
        "stamp_ns": estimate.stamp_ns,
        "position": estimate.position_m,
        "rotation": estimate.rotation,
        "covariance": estimate.covariance,
        "in_map": estimate.covariance_in_map,
        "velocity": estimate.velocity_m_s,
        "status": estimate.status.value,
        "squared": estimate.residuals.squared,
        "ms": took,
    }


if __name__ == "__main__":
    main()
