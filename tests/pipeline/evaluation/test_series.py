"""Errors over time, over stretches and against chi-square are those that were put in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pipeline.evaluation.series import bounds, calibration, error_series, stretch_errors
from pipeline.evaluation.trajectory import Trajectory, together

COUNT = 3000
SIGMAS = np.array([0.3, 0.4, 0.1])


def straight(scale: float = 1.0) -> Trajectory:
    """120 m east at 0.04 m a pose."""
    ahead = scale * 0.04 * np.arange(COUNT)
    positions = np.column_stack([ahead, np.zeros((COUNT, 2))])
    return Trajectory(np.arange(COUNT) * 10**8, positions, np.tile(np.eye(3), (COUNT, 1, 1)))


def noisy(stated: float, seed: int = 5) -> Trajectory:
    """Off by SIGMAS at random, stating a covariance that many times the true one."""
    truth = straight()
    off = np.random.default_rng(seed).normal(0, SIGMAS, (COUNT, 3))
    covariance = np.tile(stated * np.diag(SIGMAS**2), (COUNT, 1, 1))
    return replace(truth, positions_m=truth.positions_m + off, covariance=covariance)


def test_errors_over_time_stand_beside_their_sigmas():
    truth = straight()
    off = truth.moved(np.eye(3), np.array([3.0, -4.0, -2.0]))
    late = replace(off, covariance=np.tile(np.diag(SIGMAS**2), (COUNT, 1, 1))).chosen(truth.stamps_ns >= 5 * 10**9)
    series = error_series(late, truth)
    assert series.seconds[0] == 0
    assert series.seconds[-1] == pytest.approx((COUNT - 51) / 10)
    np.testing.assert_allclose(series.across_m, 5.0)
    np.testing.assert_allclose(series.up_m, -2.0)
    np.testing.assert_allclose(series.across_sigma_m, 0.5)
    np.testing.assert_allclose(series.up_sigma_m, 0.1)
    np.testing.assert_allclose(series.squared, (9 / 0.09) + (16 / 0.16) + (4 / 0.01))
    laid = error_series(late, truth, "yaw")
    np.testing.assert_allclose(laid.across_m, 0.0, atol=1e-9)
    assert laid.squared is None


def test_a_scale_error_grows_with_the_stretch_and_stretches_end_with_the_way():
    truth = straight()
    found = stretch_errors(straight(1.01), truth)
    assert [one.length_m for one in found] == [5, 10, 20, 50, 100]
    for one in found:
        assert one.metres.rmse == pytest.approx(0.01 * one.length_m, abs=0.0005)
    assert found[-1].count == COUNT - 100 / 0.04


def test_bounds_and_calibration_are_those_of_chi_square():
    assert bounds(0.95) == pytest.approx(stats.chi2(3).ppf([0.025, 0.975]))
    squared = error_series(noisy(1.0), straight()).squared
    expected, found = calibration(squared)
    np.testing.assert_allclose(found, expected, atol=0.03)
    low, high = bounds(0.9)
    assert np.mean((squared > low) & (squared < high)) == pytest.approx(0.9, abs=0.02)
    boastful, humble = (calibration(error_series(noisy(k), straight()).squared)[1] for k in (0.25, 4.0))
    assert boastful[50] < 0.2
    assert humble[50] > 0.8
    # Oracle: the share within a quantile, counted.
    assert boastful[50] == np.mean(4.0 * squared <= stats.chi2(3).ppf(0.5))


def test_two_estimates_are_compared_where_both_are_with_both_covariances():
    one, other = noisy(1.0).chosen(np.arange(COUNT) % 2 == 1), noisy(3.0, seed=6)
    late = other.chosen(other.stamps_ns >= 10**9)
    first, second = together(one, late)
    np.testing.assert_array_equal(first.stamps_ns, second.stamps_ns)
    assert first.stamps_ns[0] >= 10**9
    np.testing.assert_allclose(first.covariance, np.tile(4.0 * np.diag(SIGMAS**2), (len(first.stamps_ns), 1, 1)))
    squared = error_series(first, second).squared
    # The other is three times as good as it says: four parts are stated, two are there.
    assert squared.mean() == pytest.approx(3 * 2 / 4, rel=0.05)
