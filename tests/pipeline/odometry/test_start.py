"""Beginning in the midst of a walk, and what cannot be begun with."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.odometry.faults import delivery, laser
from benchmarks.odometry.faults.catalogue import ALL_S, PLAIN, cast_walk
from benchmarks.odometry.faults.streams import SECOND_NS, Span, Streams, each_sample
from benchmarks.odometry.faults.trial import judge, run
from drivers.sim.scenarios import scenario
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.odometry import LidarInertialOdometry


def from_then_on(streams, begin_s, lasts_s=ALL_S):
    """What is delivered of a walk from a moment on."""
    begin_ns = int(streams.truth.stamps_ns[0] + begin_s * SECOND_NS)
    span = Span(begin_ns, begin_ns + int(lasts_s * SECOND_NS))
    scans, imu = (tuple(filter(span.holds, one)) for one in (streams.scans, streams.imu))
    return Streams(scans, imu, streams.truth), span


def follows(streams, begin_s):
    """The estimates of a walk from a moment on, and how far off they were."""
    cut, span = from_then_on(streams, begin_s)
    told = run(cut, OdometryConfig())
    return cut, told.estimates, judge(told, streams.truth, span)


def tilts_deg(estimates, truth):
    """Angle between the vertical of the estimates and the true one."""
    true = truth.at(np.array([one.stamp_ns for one in estimates]))
    ups = np.array([one.rotation[2] for one in estimates])
    return np.degrees(np.arccos(np.clip((ups * true.rotations[:, 2]).sum(axis=1), -1.0, 1.0)))


@pytest.mark.parametrize("begin_s", [7.0, pytest.param(12.0, marks=pytest.mark.slow)])
def test_a_walk_can_be_joined_on_the_way(streams, begin_s):
    cut, estimates, outcome = follows(streams, begin_s)
    assert len(estimates) > len(cut.scans) - 5
    assert outcome.end_m < 0.3
    assert outcome.outside < 0.05
    assert tilts_deg(estimates, streams.truth)[-50:].max() < 1.0
    true = streams.truth.at(np.array([estimates[0].stamp_ns, estimates[0].stamp_ns + SECOND_NS // 10]))
    speed = np.linalg.norm(np.diff(true.positions_m, axis=0)) * 10
    assert np.linalg.norm(estimates[0].velocity_m_s) == pytest.approx(speed, abs=0.3)


def joined_on_the_way(name, tmp_path):
    """A ride or a flight, from its fourteenth second on."""
    config = replace(scenario(name), schedule=PLAIN.schedule, length_m=100.0)
    streams = cast_walk(config, tmp_path, 22.0)
    _, estimates, outcome = follows(streams, 13.0)
    assert len(estimates) > 80
    return tilts_deg(estimates, streams.truth)[-30:].max(), outcome


@pytest.mark.slow
def test_a_ride_can_be_joined_too(tmp_path):
    tilt_deg, outcome = joined_on_the_way("bicycle", tmp_path)
    assert outcome.end_m < 0.5
    assert outcome.outside < 0.05
    assert tilt_deg < 1.0


@pytest.mark.slow
def test_a_flight_can_be_joined(tmp_path):
    tilt_deg, outcome = joined_on_the_way("uav", tmp_path)
    assert outcome.end_m < 0.2
    assert outcome.end_m < 2.0 * outcome.end_sigma_m < 1.0
    assert outcome.outside == 0.0
    assert tilt_deg < 1.0
    assert not outcome.statuses


def refusal(streams, fault):
    """What is said of a stretch of a walk with which nothing can be begun."""
    cut, span = from_then_on(streams, 9.0, 2.5)
    spoilt = fault(cut, span)
    odometry = LidarInertialOdometry(OdometryConfig())
    for message in spoilt.imu:
        odometry.offer_imu(message)
    for scan in spoilt.scans:
        odometry.offer_scan(scan)
    assert not list(odometry.take())
    return odometry.refusal


def scaled(factor):
    """Readings of the accelerometer times something."""

    def scale(sample):
        return replace(sample, linear_acceleration=tuple(factor * f for f in sample.linear_acceleration))

    return lambda streams, span: each_sample(streams, span, scale)


@pytest.mark.parametrize(("factor", "why"), [(0.03, "falls"), (3.28, "unit")])
def test_in_free_fall_and_in_feet_nothing_is_begun(streams, factor, why):
    assert why in refusal(streams, scaled(factor))


def test_with_nothing_in_view_nothing_is_begun_on_the_way(streams):
    assert "in view" in refusal(streams, laser.handful(0))


def test_over_a_plain_nothing_is_begun_on_the_way(streams):
    said = refusal(streams, laser.field(0.02))
    assert any(why in said for why in ("nothing upright", "which way", "not clear"))


def test_with_a_hole_in_the_inertial_samples_nothing_is_begun(streams):
    begin_ns = streams.truth.stamps_ns[0] + int(9.2 * SECOND_NS)
    hole = Span(begin_ns, begin_ns + 2 * SECOND_NS)
    assert "inertial samples" in refusal(streams, lambda cut, _: delivery.no_samples(cut, hole))


def test_after_the_first_scans_that_will_not_do_later_ones_do(streams):
    cut, span = from_then_on(streams, 8.0)
    blind = laser.handful(0)(cut, Span(span.begin_ns, span.begin_ns + 3 * SECOND_NS))
    told = run(blind, OdometryConfig())
    assert told.estimates[0].stamp_ns >= span.begin_ns + 2 * SECOND_NS
    assert judge(told, streams.truth, span).end_m < 0.3
