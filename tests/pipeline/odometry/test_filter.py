import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from pipeline.odometry import so3
from pipeline.odometry.config import ImuConfig, MatchConfig
from pipeline.odometry.filter import SURPRISING, Filter, NormalEquations
from pipeline.odometry.state import ERRORS, State

MANY = 1000
STEADY = MatchConfig(iterations=30, converged_rad=1e-12, converged_m=1e-12)
TRUE_TURN, TRUE_SHIFT = np.array([0.02, -0.03, 0.05]), np.array([0.1, -0.05, 0.08])


def somewhere():
    turn = Rotation.from_euler("xyz", [0.1, -0.2, 0.7]).as_matrix()
    return State(turn, np.array([1.0, 2.0, 3.0]), *np.ones((1, 3)), *np.zeros((2, 3)), np.array([0.0, 0.0, -9.8]))


def spread(seed, size=1.0):
    """A covariance (17, 17) with correlations, about as wide as a filter's."""
    random = np.random.default_rng(seed).standard_normal((ERRORS, 2 * ERRORS))
    scale = size * np.repeat([0.02, 0.08, 0.2, 0.005, 0.05, 0.01], [3, 3, 3, 3, 3, 2])
    return np.outer(scale, scale) * (random @ random.T) / (2 * ERRORS)


def at_rest():
    """Samples (21, 7) of a scan."""
    return np.column_stack([np.linspace(0.0, 0.1, 21), np.zeros((21, 3)), np.tile([0.0, 0.0, 9.8], (21, 1))])


class Beacons:
    """Points of known places that are seen from the true pose, with noise of a given sigma."""

    def __init__(self, state, sigma, count=12, seed=3):
        random = np.random.default_rng(seed)
        turn, shift = state.rotation @ so3.exp(TRUE_TURN), state.position_m + TRUE_SHIFT
        self.places = random.uniform(-5, 5, (count, 3))
        self.seen = (self.places - shift) @ turn + sigma * random.standard_normal((count, 3))
        self.sigma = sigma

    def residuals(self, state):
        return ((self.seen @ state.rotation.T + state.position_m - self.places) / self.sigma).ravel()

    def equations(self, state, _):
        a, b = np.zeros((6, 6)), np.zeros(6)
        for q, r in zip(self.seen, self.residuals(state).reshape(-1, 3), strict=True):
            h = np.hstack([-state.rotation @ so3.hat(q), np.eye(3)]) / self.sigma
            a += h.T @ h
            b += h.T @ r
        return NormalEquations(a, b, MANY, 1.0, 1.0)


def test_an_update_is_the_most_likely_state():
    """Oracle: dense least squares over all 17 errors, the prior whitened."""
    prior, covariance = somewhere(), spread(1, size=2.0)
    beacons = Beacons(prior, 0.05)
    root = np.linalg.inv(np.linalg.cholesky(covariance))

    def cost(error):
        state = prior.plus(error)
        return np.concatenate([root @ state.minus(prior), beacons.residuals(state)])

    found = least_squares(cost, np.zeros(ERRORS), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    filter_ = Filter(prior, covariance, ImuConfig(gyro_bias_limit_rad_s=9.0, accel_bias_limit_m_s2=9.0), STEADY)
    update = filter_.update(beacons.equations)
    assert update.surprise < SURPRISING
    np.testing.assert_allclose(filter_.state.minus(prior), found.x, atol=2e-6)
    best = prior.plus(found.x)
    jacobian = np.array([(cost(found.x + e) - cost(found.x - e)) / 2e-6 for e in 1e-6 * np.eye(ERRORS)]).T
    expected = np.linalg.inv(jacobian.T @ jacobian)
    # The oracle's parameters sit at the prior, the filter's at the result: to first order the same.
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(filter_.covariance / scale, expected / scale, atol=0.05)
    assert np.linalg.norm(beacons.residuals(best)) < np.linalg.norm(beacons.residuals(prior))


def test_the_surprise_is_a_chi_square_of_six():
    """Over many draws of the true state from the prior and of the noise."""
    surprises = []
    for seed in range(200):
        random, state, covariance = np.random.default_rng(seed), somewhere(), spread(5, size=0.1)
        truth = state.plus(np.linalg.cholesky(covariance) @ random.standard_normal(ERRORS))
        beacons = Beacons(state, 0.01, count=5, seed=seed)
        beacons.seen = (beacons.places - truth.position_m) @ truth.rotation + 0.01 * random.standard_normal((5, 3))
        surprises.append(Filter(state, covariance, ImuConfig(), STEADY).update(beacons.equations).surprise)
    assert np.mean(surprises) == pytest.approx(6.0, abs=4.0 * np.sqrt(12.0 / 200))


def test_a_scan_that_contradicts_the_samples_is_followed_when_it_says_enough():
    ended = {}
    for matches in (MANY, 20):
        filter_ = Filter(somewhere(), np.diag([1e-4] * ERRORS) ** 2, ImuConfig(), STEADY)
        filter_.propagate(at_rest())
        beacons, prior = Beacons(filter_.state, 0.02), filter_.state

        def equations(state, k, beacons=beacons, matches=matches):
            told = beacons.equations(state, k)
            return NormalEquations(told.information, told.gradient, matches, 1.0, 1.0)

        assert filter_.update(equations).surprise > SURPRISING
        ended[matches] = filter_.state.minus(prior)
    np.testing.assert_allclose(ended[MANY][:6], [*TRUE_TURN, *TRUE_SHIFT], atol=0.05)
    assert np.linalg.norm(ended[MANY][3:6] - TRUE_SHIFT) < 0.5 * np.linalg.norm(ended[20][3:6] - TRUE_SHIFT)


def test_after_a_start_on_the_way_the_accelerometer_counts_for_less_at_first():
    imu = ImuConfig(accel_density_m_s2=0.01, joined_accel_density_m_s2=0.05, joined_s=0.25, accel_share=0.0)
    variances = {False: [], True: []}
    for joined, found in variances.items():
        filter_ = Filter(somewhere(), np.zeros((ERRORS, ERRORS)), imu, STEADY, joined=joined)
        for _ in range(4):
            filter_.propagate(at_rest())
            found.append(filter_.covariance[8, 8])
    grown = {joined: np.diff(found, prepend=0.0) for joined, found in variances.items()}
    np.testing.assert_allclose(grown[True] / grown[False], [25.0, 25.0, 1.0, 1.0], rtol=1e-3)


def test_biases_stay_within_what_a_sensor_can_have():
    limits = ImuConfig(gyro_bias_limit_rad_s=1e-4, accel_bias_limit_m_s2=1e-3)
    filter_ = Filter(somewhere(), spread(1), limits, STEADY)
    filter_.update(Beacons(filter_.state, 0.05).equations)
    assert np.abs(filter_.state.gyro_bias).max() <= 1e-4
    assert np.abs(filter_.state.accel_bias).max() <= 1e-3
