import numpy as np
import pytest

from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.estimate import Cloud, Residuals, Status
from pipeline.odometry.filter import SURPRISING, Filter
from pipeline.odometry.fit import Fit
from pipeline.odometry.state import ERRORS, State
from pipeline.odometry.tracker import NONE, Registration
from pipeline.odometry.watch import Watch

CONFIG = OdometryConfig()
NO_POINTS = Cloud(np.empty((0, 3), np.float32), np.empty(0, np.int64))


def seen(fit=Fit.GOOD, surprise=0.5, clusters=1000):
    residuals = Residuals(10_000, clusters, int(0.9 * clusters), 1.4, 0.95, 2, surprise)
    return Registration(NO_POINTS, residuals, None, fit, NONE)


def filter_at(spread_m=0.01, speed_m_s=1.0):
    covariance = np.eye(ERRORS) * spread_m**2
    state = State(np.eye(3), np.zeros(3), np.array([speed_m_s, 0.0, 0.0]), *np.zeros((2, 3)), np.array([0, 0, -9.8]))
    return Filter(state, covariance, CONFIG.imu, CONFIG.match)


def test_sound_scans_track_and_break_nothing():
    watch = Watch(CONFIG)
    assert {watch.follow(seen(), 0.005) for _ in range(200)} == {Status.TRACKING}
    assert not watch.broken(filter_at())


def test_a_knock_is_told_while_it_lasts_and_an_error_of_the_mounting_all_along():
    watch = Watch(CONFIG)
    assert watch.follow(seen(surprise=50.0), 0.005) is Status.DOUBTFUL
    assert watch.follow(seen(), 0.005) is Status.TRACKING
    assert not watch.contradicted
    for _ in range(60):
        watch.follow(seen(surprise=0.5 * SURPRISING), 0.005)
    assert watch.contradicted
    for _ in range(60):
        assert watch.follow(seen(surprise=0.25 * SURPRISING), 0.005) is Status.DOUBTFUL
    for _ in range(60):
        watch.follow(seen(), 0.005)
    assert not watch.contradicted


def test_what_has_never_been_worse_is_no_contradiction():
    watch = Watch(CONFIG)
    for _ in range(200):
        assert watch.follow(seen(surprise=0.25 * SURPRISING), 0.005) is Status.TRACKING


def test_what_is_guessed_over_a_silence_contradicts_nobody():
    watch = Watch(CONFIG)
    for _ in range(100):
        watch.follow(seen(surprise=0.9 * SURPRISING), 0.1)
    assert not watch.contradicted


@pytest.mark.parametrize("fit", [Fit.NONE, Fit.WRONG])
def test_scans_that_do_not_fit_are_borne_while_the_inertial_samples_know_the_place(fit):
    watch = Watch(CONFIG)
    for _ in range(CONFIG.fault.misfits + 1):
        assert watch.follow(seen(fit), 0.005) is Status.COASTING
    assert not watch.broken(filter_at(spread_m=0.5 * CONFIG.fault.coasting_m))
    assert "do not fit" in watch.broken(filter_at(spread_m=2.0 * CONFIG.fault.coasting_m))
    for _ in range(CONFIG.fault.misfits_most):
        watch.follow(seen(fit), 0.005)
    assert "do not fit" in watch.broken(filter_at())


def test_empty_scans_do_not_count_as_misfits():
    watch = Watch(CONFIG)
    for _ in range(CONFIG.fault.misfits_most + 1):
        watch.follow(seen(Fit.NONE, clusters=0), 0.005)
    assert not watch.broken(filter_at())


@pytest.mark.parametrize(("state", "why"), [({"spread_m": 5.0}, "uncertain"), ({"speed_m_s": 99.0}, "speed")])
def test_a_place_or_a_speed_that_cannot_be_is_given_up(state, why):
    assert why in Watch(CONFIG).broken(filter_at(**state))


def test_no_number_is_given_up():
    assert Watch(CONFIG).broken(filter_at(spread_m=float("nan")))
