import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pipeline.odometry.propagation_kernels import GAP_ACCEL, GAP_GYRO, Noise, propagate
from pipeline.odometry.state import (
    ACCEL_BIAS,
    ATTITUDE,
    ERRORS,
    GRAVITY,
    GRAVITY_M_S2,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    State,
    gravity_axes,
)

QUIET = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e9, 1e9, 0.05)


def somewhere(gravity=(0.3, -0.2, -9.79)):
    return State(
        Rotation.from_euler("xyz", [0.2, -0.3, 1.1]).as_matrix(),
        np.array([1.0, -2.0, 3.0]),
        np.array([1.2, 0.4, -0.1]),
        np.array([0.01, -0.02, 0.005]),
        np.array([0.1, 0.05, -0.08]),
        np.array(gravity),
    )


def walked(seconds=0.5):
    """Samples at 200 Hz of a lively gait: time, rate, force."""
    t = np.arange(0.0, seconds + 1e-9, 0.005)
    gait = 2.0 * math.pi * 1.8 * t
    rate = np.column_stack([0.6 * np.sin(gait), 0.4 * np.cos(gait), 1.0 + 0.3 * np.sin(0.5 * gait)])
    force = np.column_stack([1.5 * np.sin(gait), 0.8 * np.cos(0.5 * gait), 9.8 + 3.0 * np.cos(gait)])
    return np.column_stack([t, rate, force])


def run(state, covariance, samples, noise=QUIET):
    flat, grown, knots = propagate(state.flat(), covariance, gravity_axes(state.gravity_m_s2), samples, noise)
    return State.from_flat(flat), grown, knots


def integrated(state, samples):
    """Oracle: the equations of motion, with samples taken as linear in between, by an adaptive integrator."""

    def derivative(t, y):
        row = np.array([np.interp(t, samples[:, 0], column) for column in samples[:, 1:].T])
        x, q = row[:3] - state.gyro_bias, Rotation.from_quat(y[6:10])
        turn = 0.5 * np.array(
            [
                [0, x[2], -x[1], x[0]],
                [-x[2], 0, x[0], x[1]],
                [x[1], -x[0], 0, x[2]],
                [-x[0], -x[1], -x[2], 0],
            ]
        )
        return np.concatenate([y[3:6], q.apply(row[3:] - state.accel_bias) + state.gravity_m_s2, turn @ y[6:10]])

    start = [*state.position_m, *state.velocity_m_s, *Rotation.from_matrix(state.rotation).as_quat()]
    end = solve_ivp(derivative, (0.0, samples[-1, 0]), start, rtol=1e-9, atol=1e-10, max_step=0.005).y[:, -1]
    return end[:3], end[3:6], Rotation.from_quat(end[6:10])


def test_the_state_is_that_of_the_equations_of_motion():
    state, samples = somewhere(), walked()
    after, _, knots = run(state, np.eye(ERRORS), samples)
    position, velocity, rotation = integrated(state, samples)
    np.testing.assert_allclose(after.position_m, position, atol=1e-4)
    np.testing.assert_allclose(after.velocity_m_s, velocity, atol=3e-4)
    assert (rotation.inv() * Rotation.from_matrix(after.rotation)).magnitude() < 1e-5
    np.testing.assert_allclose(after.rotation @ after.rotation.T, np.eye(3), atol=1e-14)
    np.testing.assert_array_equal(knots[-1, 10:13], after.position_m)
    np.testing.assert_array_equal(knots[0, 10:13], state.position_m)
    np.testing.assert_array_equal(knots[:, 0], samples[:, 0])


def test_standing_still_stays_put():
    state = State(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.array([0.0, 0.0, -9.80665]))
    samples = np.column_stack([np.arange(0.0, 2.0, 0.005), np.zeros((400, 3)), np.tile([0.0, 0.0, 9.80665], (400, 1))])
    after, _, _ = run(state, np.eye(ERRORS), samples)
    np.testing.assert_allclose(after.flat(), state.flat(), atol=1e-12)


def test_without_noise_the_covariance_is_carried_by_the_derivative():
    """Oracle: finite differences of the same propagation, through the state's own plus and minus."""
    state, samples = somewhere(), walked()
    after, _, _ = run(state, np.eye(ERRORS), samples)
    derivative, step = np.empty((ERRORS, ERRORS)), 1e-6
    for k in range(ERRORS):
        nudge = np.zeros(ERRORS)
        nudge[k] = step
        up, down = (run(state.plus(s * nudge), np.eye(ERRORS), samples)[0].minus(after) for s in (1.0, -1.0))
        derivative[:, k] = (up - down) / (2.0 * step)
    spread = np.random.default_rng(1).standard_normal((ERRORS, ERRORS))
    covariance = spread @ spread.T
    _, grown, _ = run(state, covariance, samples)
    expected = derivative @ covariance @ derivative.T
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # The kernel leaves out what is of second order in its step of 5 ms.
    np.testing.assert_allclose(grown / scale, expected / scale, atol=5e-3)


def test_noise_spreads_the_state_as_the_covariance_says():
    """Oracle: many propagations through noisy samples whose biases walk."""
    random, count, dt = np.random.default_rng(2), 3000, 0.005
    gyro, accel, gyro_walk, accel_walk = 2e-3, 3e-2, 3e-3, 2e-2
    noise = QUIET._replace(gyro_density=gyro, accel_density=accel, gyro_walk=gyro_walk, accel_walk=accel_walk)
    state, samples = somewhere(), walked()
    after, covariance, _ = run(state, np.zeros((ERRORS, ERRORS)), samples, noise)
    errors = np.empty((count, ERRORS))
    white, walk = np.repeat([gyro, accel], 3) / math.sqrt(dt), np.repeat([gyro_walk, accel_walk], 3) * math.sqrt(dt)
    for k in range(count):
        bias = np.cumsum(walk * random.standard_normal((len(samples), 6)), axis=0)
        noisy = samples.copy()
        noisy[:, 1:] -= bias + white * random.standard_normal((len(samples), 6))
        run_off = run(state, np.zeros((ERRORS, ERRORS)), noisy)[0].minus(after)
        run_off[GYRO_BIAS], run_off[ACCEL_BIAS] = bias[-1, :3], bias[-1, 3:]
        errors[k] = run_off
    for part in (ATTITUDE, VELOCITY, POSITION, GYRO_BIAS, ACCEL_BIAS):
        np.testing.assert_allclose(np.sqrt(np.diag(covariance)[part]), errors[:, part].std(axis=0), rtol=0.06)
    correlation = covariance[POSITION, VELOCITY] / np.sqrt(
        np.outer(np.diag(covariance)[POSITION], np.diag(covariance)[VELOCITY])
    )
    np.testing.assert_allclose(correlation, np.corrcoef(errors[:, :9].T)[POSITION, VELOCITY], atol=0.06)


def test_gravity_walks_and_takes_the_speed_along():
    walk, took_s = 1e-3, 0.5
    state, noise = somewhere((0.0, 0.0, -GRAVITY_M_S2)), QUIET._replace(gravity_walk=walk)
    _, covariance, _ = run(state, np.zeros((ERRORS, ERRORS)), walked(took_s), noise)
    np.testing.assert_allclose(covariance[GRAVITY, GRAVITY], walk**2 * took_s * np.eye(2), atol=1e-15)
    speeds = np.sqrt(np.diag(covariance)[VELOCITY])
    np.testing.assert_allclose(speeds[:2], GRAVITY_M_S2 * walk * math.sqrt(took_s**3 / 3.0), rtol=0.02)
    assert speeds[2] == 0.0


def test_over_a_silence_the_speed_is_kept_and_little_is_known():
    state = somewhere()
    samples = np.array([[0.0, 0.5, 0.5, 0.5, 3.0, 1.0, 12.0], [0.4, 0.5, 0.5, 0.5, 3.0, 1.0, 12.0]])
    after, covariance, _ = run(state, np.zeros((ERRORS, ERRORS)), samples)
    np.testing.assert_allclose(after.rotation, state.rotation, atol=1e-12)
    np.testing.assert_allclose(after.velocity_m_s, state.velocity_m_s)
    np.testing.assert_allclose(after.position_m, state.position_m + 0.4 * state.velocity_m_s)
    assert covariance[0, 0] == pytest.approx(GAP_GYRO**2 * 0.4)
    assert covariance[6, 6] == pytest.approx(GAP_ACCEL**2 * 0.4)
    assert covariance[3, 3] == pytest.approx(GAP_ACCEL**2 * 0.4**3 / 3.0)


def test_at_the_end_of_its_range_a_reading_says_less():
    noise = QUIET._replace(gyro_range=2.0, accel_range=20.0)
    samples = walked()
    _, usual, _ = run(somewhere(), np.zeros((ERRORS, ERRORS)), samples, noise)
    assert not usual[:9, :9].any()
    samples[20:40, 1] = 2.0
    _, turned, _ = run(somewhere(), np.zeros((ERRORS, ERRORS)), samples, noise)
    assert turned[0, 0] > 1e-4
    samples[20:40, 1], samples[20:40, 6] = 0.0, 20.0
    _, pushed, _ = run(somewhere(), np.zeros((ERRORS, ERRORS)), samples, noise)
    assert pushed[8, 8] > 1e-2
