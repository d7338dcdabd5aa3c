import math

import numpy as np
import pytest

from pipeline.gnss import belief as small
from pipeline.gnss.belief import Belief, Observation
from pipeline.gnss.config import FusionConfig

PLAIN = FusionConfig(correlation_s=0.0)


def some_belief():
    spread = np.random.default_rng(1).standard_normal((13, 13))
    return Belief(np.arange(13) * 0.1, spread @ spread.T / 13 + 0.1 * np.eye(13))


def test_a_correction_is_the_weighted_mean():
    """Oracle: information filter. Weight 1, white noise."""
    belief, seen = some_belief(), Observation(np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.5, 0.8]), 1)
    new = small.innovation(belief, seen, PLAIN)
    after = small.corrected(belief, new, np.ones(3))
    noise = np.diag(1.0 / seen.sigma_m**2)
    covariance = np.linalg.inv(np.linalg.inv(belief.covariance) + new.jacobian.T @ noise @ new.jacobian)
    mean = covariance @ (np.linalg.solve(belief.covariance, belief.mean) + new.jacobian.T @ noise @ seen.position_m)
    np.testing.assert_allclose(after.covariance, covariance, atol=1e-9)
    np.testing.assert_allclose(after.mean, mean, atol=1e-9)


def test_the_chi_squares_are_those_of_the_covariance_blocks():
    belief, seen = some_belief(), Observation(np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.5, 0.8]), 0)
    new = small.innovation(belief, seen, FusionConfig())
    across = new.value[:2] @ np.linalg.inv(new.covariance[:2, :2]) @ new.value[:2]
    assert new.chi2 == pytest.approx((across, new.value[2] ** 2 / new.covariance[2, 2]))


def test_the_pull_of_a_fix_is_bounded():
    belief = Belief(np.zeros(13), np.eye(13))
    pulls = []
    for off_m in (1.0, 10.0, 100.0, 1000.0):
        new = small.innovation(belief, Observation(np.array([off_m, 0.0, 0.0]), np.ones(3), 1), PLAIN)
        after = small.corrected(belief, new, small.huber_weights(new.chi2, PLAIN))
        pulls.append(after.mean[0])
        assert after.covariance[0, 0] < 1.0 + 1e-12
    # Whitened by the root of 3 (place, lasting error and noise); beyond 1.5 * 1.345 the pull stays what it is.
    assert pulls[0] == pytest.approx(1.0 / 3.0)
    assert pulls[1:] == pytest.approx([1.5 * 1.345 / math.sqrt(3.0)] * 3)


def test_the_transition_is_the_derivative():
    belief = some_belief()
    step, lasting, keep = np.array([1.0, -2.0, 0.3]), np.full(9, 0.5), 0.9
    ahead, transition = small.moved(belief, step, np.zeros(4), keep, lasting)
    for k in range(13):
        nudge = np.zeros(13)
        nudge[k] = 1e-6
        other, _ = small.moved(Belief(belief.mean + nudge, belief.covariance), step, np.zeros(4), keep, lasting)
        np.testing.assert_allclose((other.mean - ahead.mean) / 1e-6, transition[:, k], atol=1e-5)


def test_a_lasting_error_forgets_itself():
    belief = small.started(np.zeros(3), 0.0, np.eye(4), np.full(9, 2.0))
    after, _ = small.moved(belief, np.zeros(3), np.zeros(4), 0.3, np.full(9, 2.0))
    np.testing.assert_allclose(np.diag(after.covariance)[4:], 4.0)
