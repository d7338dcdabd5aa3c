"""After the warm-up a walk compiles nothing more: nobody waits a minute for the first pose in the field."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROGRAM = """
import sys
from math import sin

import numpy as np
from numba.core.registry import CPUDispatcher

from drivers.messages import ImuSample, LidarScan
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.odometry import LidarInertialOdometry
from pipeline.odometry.warm import warm_up


def compiled():
    modules = [module for name, module in sys.modules.items() if name.startswith("pipeline.odometry")]
    return {
        f"{module.__name__}.{name}": len(kernel.signatures)
        for module in modules
        for name, kernel in vars(module).items()
        if isinstance(kernel, CPUDispatcher)
    }


warm_up(OdometryConfig())
warm = compiled()
assert warm["pipeline.odometry.match_kernels.match"] == 1, warm
assert warm["pipeline.odometry.vote_kernels.votes"] == 1, warm
odometry, noise = LidarInertialOdometry(OdometryConfig()), np.random.default_rng(3)
wall = np.column_stack([noise.uniform(-9, 9, (2, 4000)).T, np.zeros(4000)])
points = np.asfortranarray(np.vstack([np.roll(wall, k, axis=1) + 3.0 for k in range(3)]), np.float32)
found = 0
for k in range(40):
    for i in range(20):
        at_s, stamp = 0.1 * k + 0.005 * i, 10**9 + k * 10**8 + i * 5 * 10**6
        swing = 0.0 if k < 15 else sin(at_s)
        odometry.offer_imu(ImuSample(stamp, stamp, (0.0, 0.0, swing), (0.1 * swing, 0.0, 9.81)))
    octets, offsets = np.full((3, len(points)), 16, np.uint8), np.arange(len(points), dtype=np.uint32) * 8000
    odometry.offer_scan(LidarScan(10**9 + k * 10**8, 0, points, octets[0], octets[1] * 0, octets[2], offsets))
    found += sum(1 for _ in odometry.take())
assert found > 20, found
assert compiled() == warm, {name: count for name, count in compiled().items() if warm[name] != count}
"""


def test_a_walk_after_the_warm_up_compiles_nothing():
    root = Path(__file__).parents[3]
    subprocess.run([sys.executable, "-c", PROGRAM], cwd=root, check=True)
