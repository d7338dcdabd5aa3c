import numpy as np
import pytest

from pipeline.evaluation.clocks import ClockEstimates, ClockTruth, clock_errors

S = 1_000_000_000


def truth(seconds, skew_ppm, offset_ns, start_ns=0):
    host = start_ns + np.arange(0, seconds * S, S // 10, dtype=np.int64)
    sensor = host - offset_ns - np.rint((host - start_ns) * skew_ppm * 1e-6).astype(np.int64)
    return host, sensor


def estimates(host, sensor, error_ns, skew_ppm, sigma_ns):
    rows = slice(None, None, 10)
    size = host[rows].size
    return ClockEstimates(
        host[rows],
        sensor[rows],
        host[rows] - sensor[rows] + error_ns,
        np.full(size, skew_ppm),
        np.full(size, float(sigma_ns)),
    )


def test_a_constant_latency_and_the_scatter_are_told_apart():
    host, sensor = truth(60, 20.0, 5 * S)
    scatter = np.where(np.arange(60) % 2, 1_000_000, -1_000_000)
    errors = clock_errors(estimates(host, sensor, 7_000_000 + scatter, 19.0, 500_000), ClockTruth(host, sensor))
    assert errors.latency_ms == pytest.approx(7.0, abs=1.1)
    assert errors.rms_ms == pytest.approx(1.0, rel=0.5)
    assert errors.true_skew_ppm == pytest.approx(20.0, abs=0.1)
    assert errors.skew_ppm == 19.0


def test_epochs_are_compared_with_their_own_line():
    first, second = truth(30, 20.0, 5 * S), truth(30, 20.0, 40 * S, start_ns=30 * S)
    host, sensor = np.concatenate((first[0], second[0])), np.concatenate((first[1], second[1]))
    errors = clock_errors(estimates(host, sensor, 0, 20.0, 1e5), ClockTruth(host, sensor))
    assert errors.epochs == 2
    assert errors.worst_ms < 0.01
    assert errors.within_3_sigma == 1.0


def test_too_short_a_recording_is_refused():
    host, sensor = truth(5, 0.0, 0)
    with pytest.raises(ValueError, match="record for longer"):
        clock_errors(estimates(host, sensor, 0, 0.0, 1.0), ClockTruth(host, sensor))
