import numpy as np
import pytest

from drivers.clock import SensorClock

S = 1_000_000_000


def arrivals(rate_hz, seconds, *, skew_ppm=30.0, offset_ns=7 * S, jitter_s=1e-3, seed=1, start_ns=0):
    """(sensor, receive, true host) triples of a clock with exponential transport delay."""
    random = np.random.default_rng(seed)
    host = start_ns + (np.arange(int(rate_hz * seconds)) * S / rate_hz).astype(np.int64)
    sensor = ((host - offset_ns) / (1 + skew_ppm * 1e-6)).astype(np.int64)
    receive = host + (random.exponential(jitter_s, host.size) * S).astype(np.int64)
    return sensor, receive, host


def feed(clock, sensor, receive):
    steps = [clock.observe(int(s), int(r)) for s, r in zip(sensor, receive, strict=True)]
    return [step for step in steps if step is not None]


def stamps(clock, sensor, receive):
    out = []
    for s, r in zip(sensor, receive, strict=True):
        clock.observe(int(s), int(r))
        out.append(clock.to_host_ns(int(s)))
    return np.array(out)


@pytest.mark.parametrize(("rate_hz", "jitter_s", "within_ms"), [(2000, 2e-4, 0.1), (200, 1e-3, 0.3), (30, 8e-3, 2.0)])
def test_offset_and_skew_are_found_under_jitter(rate_hz, jitter_s, within_ms):
    clock = SensorClock()
    sensor, receive, host = arrivals(rate_hz, 60, jitter_s=jitter_s)
    given = stamps(clock, sensor, receive)
    settled = host > 20 * S
    assert np.abs(given - host)[settled].max() < within_ms * 1e6
    assert abs(clock.state().skew_ppm - 30.0) < 15.0 * within_ms


def test_stated_sigma_is_honest_over_seeds():
    ratios = []
    for seed in range(20):
        clock = SensorClock()
        sensor, receive, host = arrivals(30, 60, jitter_s=5e-3, seed=seed)
        given = stamps(clock, sensor, receive)
        ratios.append((given[-1] - host[-1]) / clock.state().sigma_ns)
    assert 0.3 < np.std(ratios) < 2.0
    assert np.abs(ratios).max() < 5.0


def test_constant_latency_is_taken_out_when_known():
    clock = SensorClock(latency_ns=20_000_000)
    sensor, receive, host = arrivals(100, 30, jitter_s=1e-4)
    given = stamps(clock, sensor, receive + 20_000_000)
    assert np.abs(given - host)[-500:].max() < 1e6


def test_map_is_continuous_monotonic_and_the_same_for_both_streams():
    clock = SensorClock()
    sensor, receive, _ = arrivals(500, 30, jitter_s=3e-3)
    receive[0] += 40_000_000  # the very first arrival is badly late
    points = stamps(clock, sensor, receive)
    imu = np.array([clock.to_host_ns(int(s)) for s in sensor[-1000:]])
    assert np.array_equal(imu, points[-1000:])
    assert np.abs(np.diff(points) / np.diff(sensor) - 1.0).max() < 0.011


def test_reboot_starts_a_new_map():
    clock = SensorClock()
    sensor, receive, _ = arrivals(200, 100, offset_ns=-3600 * S)
    feed(clock, sensor, receive)
    sensor2, receive2, host2 = arrivals(200, 30, offset_ns=112 * S, start_ns=112 * S)
    steps = feed(clock, sensor2, receive2)
    assert [step.reboot for step in steps] == [True]
    assert abs(clock.to_host_ns(int(sensor2[-1])) - host2[-1]) < 2e6


@pytest.mark.parametrize("jump_s", [2.5, -2.5, 0.3, -0.3])
def test_step_of_the_sensor_clock_is_seen_once_and_followed(jump_s):
    clock = SensorClock()
    sensor, receive, host = arrivals(200, 60)
    stepped = sensor + np.where(host > 30 * S, int(jump_s * S), 0)
    steps = feed(clock, stepped, receive)
    assert len(steps) == 1
    assert abs(steps[0].jump_ns + jump_s * S) < 0.02 * S
    assert not steps[0].reboot
    assert abs(clock.to_host_ns(int(stepped[-1])) - host[-1]) < 2e6


def test_backlog_after_a_stall_is_not_a_step():
    clock = SensorClock()
    sensor, receive, host = arrivals(200, 40, jitter_s=1e-4)
    stalled = (host > 20 * S) & (host < 27 * S)
    receive[stalled] = 27 * S + np.arange(stalled.sum()) * 10_000  # seven seconds arrive at once
    assert feed(clock, sensor, receive) == []
    assert abs(clock.to_host_ns(int(sensor[-1])) - host[-1]) < 1e6


def test_silence_of_minutes_is_bridged():
    clock = SensorClock()
    sensor, receive, host = arrivals(200, 400, jitter_s=1e-4)
    heard = (host < 60 * S) | (host > 300 * S)
    assert feed(clock, sensor[heard], receive[heard]) == []
    assert abs(clock.to_host_ns(int(sensor[-1])) - host[-1]) < 1e6


def test_stamp_before_first_arrival_is_refused():
    with pytest.raises(ValueError, match="observe"):
        SensorClock().to_host_ns(5)
