"""The real odometry over a cast walk, as the fusion gets it; run once and kept beside the walk."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from benchmarks.fusion.odometry import Odometry
from benchmarks.odometry.simulated import EPOCH_NS, walk
from drivers.sim.world import World
from pipeline.estimates import OdometryEstimate
from pipeline.odometry.estimate import Status

STRIDE_M = 0.05
POSITION_FIRST = [3, 4, 5, 0, 1, 2]


def tracked(world: World, cache: Path) -> Odometry:
    """Estimates in walk time. Alone: laid on the truth at the start by position and heading."""
    one = walk(world.config, cache)
    source = one.folder / "ours_1.npz"
    if not source.exists():
        subprocess.run([sys.executable, "-m", "benchmarks.odometry.run_ours", str(one.folder), str(source)], check=True)
    found = np.load(source)
    stamps = found["stamp_ns"] - EPOCH_NS
    inside = stamps <= world.trajectory.duration_ns
    stamps = stamps[inside]
    position, rotation, velocity = (found[name][inside] for name in ("position", "rotation", "velocity"))
    covariance = found["covariance"][inside][:, POSITION_FIRST][:, :, POSITION_FIRST]
    weak = np.isin(
        found["status"][inside], [one.value for one in (Status.DEGENERATE, Status.DOUBTFUL, Status.COASTING)]
    )
    way = _travelled(position)
    estimates = [
        OdometryEstimate(
            stamp_ns=int(stamp),
            position_m=position[k],
            rotation=rotation[k],
            velocity_m_s=velocity[k],
            covariance=covariance[k],
            gyro_bias=np.zeros(3),
            accel_bias=np.zeros(3),
            travelled_m=float(way[k]),
            degenerate=bool(weak[k]),
            weak_directions=np.zeros((0, 3)),
            points=2000,
            matches=1500,
        )
        for k, stamp in enumerate(stamps)
    ]
    truth, rotations = world.trajectory.poses(stamps)
    alone = (position - position[0]) @ level(rotations[0] @ rotation[0].T).T + truth[0] - truth
    return Odometry(estimates, truth, np.linalg.norm(alone, axis=1))


def level(turn: np.ndarray) -> np.ndarray:
    """(3, 3) the yaw of a rotation alone."""
    yaw = np.arctan2(turn[1, 0], turn[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _travelled(position: np.ndarray) -> np.ndarray:
    """(n,) m, in strides: standing still adds nothing."""
    way, stood = np.zeros(len(position)), position[0]
    for k in range(1, len(position)):
        stride = float(np.linalg.norm(position[k] - stood))
        way[k] = way[k - 1]
        if stride > STRIDE_M:
            way[k] += stride
            stood = position[k]
    return way
