"""The clock map on the receiver's own quirks, in virtual time against a known line."""

import random

import numpy as np
import pytest

from drivers.reach.epoch import Instant
from drivers.reach.timing import ReceiverClock
from drivers.sim.reach_emulator import UtcLine

SECOND = 10**9
UTC0 = 1_800_000_000 * SECOND
HOST0 = 5_000 * SECOND


def test_stamps_follow_the_true_instants_in_spite_of_jitter_and_drift():
    """Oracle: the line itself; the constant latency of 30 ms is told to the driver."""
    rng = random.Random(3)
    line = UtcLine(HOST0, UTC0)
    line.drift(HOST0, 20.0)
    clock = ReceiverClock(latency_ns=30_000_000)
    errors_ms = []
    for k in range(5 * 180):
        utc_ns = UTC0 + k * SECOND // 5
        arrival_ns = line.host_at(utc_ns) + 30_000_000 + round(rng.expovariate(1 / 0.01) * 1e9)
        stamp_ns, step = clock.stamp(Instant(utc_ns, arrival_ns, leap_second=False), date_assumed=False)
        assert step is None
        errors_ms.append((stamp_ns - line.host_at(utc_ns)) / 1e6)
    settled = np.abs(errors_ms[5 * 30 :])
    assert settled.max() < 3.0
    state = clock.state()
    assert state is not None
    assert state.skew_ppm == pytest.approx(-20.0, abs=8.0)


@pytest.mark.parametrize("step_s", [18, 1, -1, 3600])
def test_a_receiver_that_corrects_its_utc_steps_and_the_stamps_go_on(step_s):
    """18 s: a cold start before the almanac's leap seconds."""
    line = UtcLine(HOST0, UTC0)
    clock = ReceiverClock(latency_ns=0)
    steps, worst_ms = [], 0.0
    next_utc_ns = UTC0
    for k in range(300):
        if k == 150:
            line.step(step_s * SECOND)
            next_utc_ns += step_s * SECOND
        host_ns = line.host_at(next_utc_ns)
        stamp_ns, step = clock.stamp(Instant(next_utc_ns, host_ns, leap_second=False), date_assumed=False)
        steps += [step] if step else []
        worst_ms = max(worst_ms, abs(stamp_ns - host_ns) / 1e6)
        next_utc_ns += SECOND // 5
    assert [round(-step.jump_ns / SECOND) for step in steps] == [step_s]
    assert worst_ms < 1.0


def test_a_leap_second_is_no_step_and_time_goes_on():
    clock = ReceiverClock(latency_ns=0)
    stamps = []
    for k in range(-50, 50):
        host_ns = HOST0 + k * SECOND // 5
        leap = 0 <= k < 5
        utc_ns = UTC0 + (k if k < 5 else k - 5) * SECOND // 5
        stamp_ns, step = clock.stamp(Instant(utc_ns, host_ns, leap), date_assumed=False)
        assert step is None
        stamps.append(stamp_ns)
        assert abs(stamp_ns - host_ns) < 1_000_000
    assert stamps == sorted(stamps)


def test_a_date_that_becomes_known_is_no_step():
    clock = ReceiverClock(latency_ns=0)
    for k in range(20):
        known = k >= 10
        utc_ns = UTC0 + k * SECOND - (0 if known else 400 * 86400 * SECOND)
        stamp_ns, step = clock.stamp(Instant(utc_ns, HOST0 + k * SECOND, leap_second=False), date_assumed=not known)
        assert step is None
        assert abs(stamp_ns - (HOST0 + k * SECOND)) < 1_000_000
