"""The pipeline falls behind by points, not by time."""

from __future__ import annotations

import numpy as np

from drivers.messages import ImuSample, LidarScan
from edge.live.governor import LEAST_SHARE, MOST_WAITING, Governor, thinned
from edge.replay.pairing import Sweep

MS = 1_000_000


def sweep(k: int, points: int = 1000) -> Sweep:
    octets = np.zeros((3, points), np.uint8)
    octets[0, 17] = 200
    offsets = np.linspace(0, 99 * MS, points).astype(np.uint32)
    scan = LidarScan(k * 100 * MS, 0, np.ones((points, 3), np.float32), *octets, offsets)
    return Sweep(scan, (ImuSample(k * 100 * MS, 0, (0.0,) * 3, (0.0,) * 3),))


def run(cost_s, sweeps: int = 200) -> tuple[Governor, list[int]]:
    """Sweeps come every 100 ms, each takes cost_s(points); returns the points of those that were worked on."""
    governor, now_s, points, came = Governor(), 0.0, [], 0
    while came < sweeps:
        while came < sweeps and came * 0.1 <= now_s:
            governor.add(sweep(came))
            came += 1
        taken = governor.next()
        if taken is None:
            now_s = came * 0.1
            continue
        points.append(len(taken.scan.xyz_m))
        seconds = cost_s(points[-1])
        governor.took(seconds)
        now_s += seconds
    return governor, points


def test_a_quick_computer_uses_every_point_of_every_sweep():
    governor, points = run(lambda n: n * 20e-6)
    assert governor.dropped == 0
    assert set(points) == {1000}


def test_a_slow_one_uses_fewer_points_and_soon_leaves_out_no_sweep():
    governor, points = run(lambda n: n * 200e-6)
    assert governor.dropped <= 5
    assert 200 < np.mean(points[-50:]) < 500


def test_when_it_cools_down_the_points_come_back():
    state = {"slow": True}
    governor, _ = run(lambda n: n * (200e-6 if state["slow"] else 20e-6), 100)
    assert governor.share < 0.6
    for k in range(100):
        governor.add(sweep(1000 + k))
        assert governor.next() is not None
        governor.took(0.01)
    assert governor.share == 1.0


def test_one_that_cannot_keep_up_at_all_leaves_out_sweeps_and_no_inertial_data():
    governor = Governor()
    for k in range(10):
        governor.add(sweep(k))
        governor.took(1.0)
    for _ in range(20):
        governor.took(1.0)
    assert governor.share == LEAST_SHARE
    assert governor.dropped == 10 - MOST_WAITING
    first = governor.next()
    assert first is not None
    assert [sample.stamp_ns for sample in first.imu] == [k * 100 * MS for k in range(8)]


def test_thinning_is_even_in_time_and_keeps_reflectors():
    scan = thinned(sweep(0).scan, 0.1)
    assert len(scan.xyz_m) in (100, 101)
    assert scan.reflectivity.max() == 200
    assert np.diff(scan.offset_ns.astype(int)).max() < 1.5 * MS
    assert len(thinned(sweep(0, 18).scan, 0.1).xyz_m) == 2
