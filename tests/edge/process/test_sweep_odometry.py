"""The odometry by sweeps, on the real kernels and a room of four walls."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.messages import ImuSample, LidarScan
from edge.process.sweep_odometry import SweepOdometry
from edge.replay.pairing import Pairing
from pipeline.odometry.config import OdometryConfig

S, MS = 1_000_000_000, 1_000_000
pytestmark = pytest.mark.slow


def room(k: int, points: int = 4000) -> np.ndarray:
    noise = np.random.default_rng(k)
    along = noise.uniform(-8, 8, (points, 3))
    wall = noise.integers(0, 3, points)
    along[np.arange(points), wall] = np.where(noise.random(points) < 0.5, -8, 8)
    along[:, 2] = np.clip(along[:, 2], -1.5, 4)
    return (along + noise.normal(0, 0.01, along.shape)).astype(np.float32)


def standing(seconds: float):
    offsets = np.linspace(0, 99 * MS, 4000).astype(np.uint32)
    octets = np.full((3, 4000), 40, np.uint8)
    octets[1:] = 0
    for t in range(0, int(seconds * 1000), 5):
        at = S + t * MS
        yield ImuSample(at, at, (0.0, 0.0, 0.0), (0.0, 0.0, 9.80665))
        if t % 100 == 0:
            yield LidarScan(at, at, room(t), *octets, offsets)


def run(messages):
    odometry, pairing = SweepOdometry(OdometryConfig()), Pairing()
    found = [one for m in messages for sweep in pairing.add(m) for one in odometry.process(sweep)]
    for sweep in pairing.flush():
        found += odometry.process(sweep)
    return [*found, *odometry.flush()]


def test_standing_still_is_a_point_and_its_points_are_the_room():
    found = run(standing(4.0))
    assert len(found) >= 25
    last = found[-1]
    assert np.linalg.norm(last.estimate.position_m) < 0.05
    assert last.estimate.travelled_m < 0.2
    assert last.estimate.covariance.shape == (6, 6)
    assert last.cloud.shape[1] == 4
    assert len(last.cloud) > 1000
    level = np.abs(last.cloud[:, :2]).max(axis=1)
    assert np.quantile(level, 0.9) < 8.4
    assert set(np.unique(last.cloud[:, 3])) == {40.0}
    stamps = [one.estimate.stamp_ns for one in found]
    assert stamps == sorted(stamps)


def test_the_points_of_a_guess_are_not_for_the_map():
    messages = [m for m in standing(6.0) if not 3 * S < m.stamp_ns < 5 * S]
    found = run(messages)
    guesses = [one for one in found if not len(one.cloud)]
    assert guesses
    assert all(one.estimate.note for one in guesses)
    assert np.linalg.norm(found[-1].estimate.position_m) < 0.2
