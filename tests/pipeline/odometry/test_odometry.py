"""The odometry as a whole, over the first half minute of a simulated walk."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.odometry.faults import delivery
from benchmarks.odometry.faults.streams import SECOND_NS, Span
from benchmarks.odometry.faults.trial import judge, run
from drivers.messages import LidarScan
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.odometry import LidarInertialOdometry


@pytest.fixture(scope="module")
def told(streams):
    return run(streams, OdometryConfig())


def test_a_walk_is_followed_within_centimetres_and_the_sigma_covers_it(streams, told):
    begin_ns = int(streams.truth.stamps_ns[0]) + 4 * SECOND_NS
    outcome = judge(told, streams.truth, Span(begin_ns, 2**62))
    assert len(told.estimates) == len(streams.scans)
    assert np.linalg.norm(streams.truth.positions_m[-1] - streams.truth.positions_m[0]) > 5.0  # it did walk
    assert outcome.worst_m < 0.05
    assert outcome.outside == 0.0
    assert outcome.end_sigma_m < 0.5
    assert not outcome.statuses
    assert not outcome.notes


def test_the_same_input_gives_the_same_poses(streams, told):
    again = run(replace(streams, scans=streams.scans[:60], imu=streams.imu[:1240]), OdometryConfig()).estimates
    assert all(
        np.array_equal(a.position_m, b.position_m) and np.array_equal(a.rotation, b.rotation)
        for a, b in zip(again[:50], told.estimates[:50], strict=True)
    )


def test_stamps_rise_and_points_are_those_of_the_scan(streams, told):
    stamps = [one.stamp_ns for one in told.estimates]
    assert stamps == sorted(set(stamps))
    for scan, one in zip(streams.scans[::50], told.estimates[::50], strict=True):
        assert len(one.cloud.xyz_m) == len(one.cloud.index) > 1000
        assert one.cloud.index.max() < len(scan.xyz_m)


def test_without_inertial_samples_nothing_is_claimed(streams):
    cut = replace(streams, scans=streams.scans[:30], imu=())
    odometry = LidarInertialOdometry(OdometryConfig())
    for scan in cut.scans:
        odometry.offer_scan(scan)
    assert not list(odometry.take(flush=True))
    assert "inertial samples" in odometry.refusal
    assert odometry.counts.refusals > 0


def test_what_is_late_is_counted(streams):
    cut = replace(streams, scans=streams.scans[:80], imu=streams.imu[:1640])
    late = delivery.late_scans(1.0, 5)(cut, Span(int(cut.truth.stamps_ns[0]) + 4 * SECOND_NS, 2**62))
    odometry, found = LidarInertialOdometry(OdometryConfig()), 0
    for message in late.delivered():
        if isinstance(message, LidarScan):
            odometry.offer_scan(message)
            found += len(list(odometry.take()))
        else:
            odometry.offer_imu(message)
            odometry.offer_imu(message)
    counts = odometry.counts
    assert counts.late_scans > 0
    assert counts.late_imu == len(late.imu)
    assert counts.scans == found
    assert counts.late_scans + counts.scans > 75
