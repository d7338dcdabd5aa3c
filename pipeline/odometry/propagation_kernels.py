"""Propagation through inertial samples: the state, its covariance and the knots for deskewing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.odometry.so3 import Doubles, exp, hat, right_jacobian

KNOT = 22
"""Columns of a knot: time (s), rotation row by row, position, velocity, acceleration in odom, rate in the body."""
CORRELATED_S = 0.1
SATURATED_GYRO, SATURATED_ACCEL = 0.15, 1.5
"""Densities (a root hertz) that are added where a reading is at the end of its range."""
GAP_GYRO, GAP_ACCEL = 0.2, 2.0
"""And where no reading is: a walker's motion over a silence."""


class Noise(NamedTuple):
    """Of the process, in SI units: densities are a root hertz, walks a root second, shares of rate and acceleration.

    Ranges are those of the sensor. A step longer than `longest_step_s` is a gap.
    """

    gyro_density: float
    accel_density: float
    gyro_walk: float
    accel_walk: float
    gravity_walk: float
    gyro_share: float
    accel_share: float
    gyro_range: float
    accel_range: float
    longest_step_s: float


@njit(cache=True, nogil=True)
def propagate(
    state: Doubles, covariance: Doubles, axes: Doubles, imu: Doubles, noise: Noise
) -> tuple[Doubles, Doubles, Doubles]:
    """State (24,), covariance (17, 17) and knots (m, KNOT) after the samples imu (m, 7): time (s), rate, force.

    Rates and forces are taken as linear between samples. Formulas: FAST-LIO2, with trapezoids.
    """
    count = len(imu)
    knots = np.empty((count, KNOT))
    rotation = state[:9].copy().reshape(3, 3)
    position, velocity = state[9:12].copy(), state[12:15].copy()
    gyro_bias, accel_bias, gravity = state[15:18], state[18:21], state[21:24]
    p = covariance.copy()
    f = np.eye(17)
    tilt = -hat(gravity) @ axes
    rate, acceleration = np.zeros(3), np.zeros(3)
    for k in range(count - 1):
        dt = imu[k + 1, 0] - imu[k, 0]
        rate = 0.5 * (imu[k, 1:4] + imu[k + 1, 1:4]) - gyro_bias
        unheard = dt > noise.longest_step_s
        if unheard:
            rate[:] = 0.0  # nobody knows: the speed is kept, the turn is not
        turn = exp(rate * dt)
        after = rotation @ turn
        force = 0.5 * (imu[k, 4:7] + imu[k + 1, 4:7]) - accel_bias
        acceleration = 0.5 * (rotation @ (imu[k, 4:7] - accel_bias) + after @ (imu[k + 1, 4:7] - accel_bias)) + gravity
        if unheard:
            acceleration[:] = 0.0
        _write(knots[k], imu[k, 0], rotation, position, velocity, acceleration, rate)

        half = rotation @ exp(0.5 * rate * dt)
        lean = -half @ hat(force) * dt
        jacobian = right_jacobian(rate * dt)
        for i in range(3):
            f[3 + i, 6 + i] = dt
            for j in range(3):
                f[i, j] = turn[j, i]
                f[i, 9 + j] = -jacobian[i, j] * dt
                f[3 + i, j] = 0.5 * dt * lean[i, j]
                f[6 + i, j] = lean[i, j]
                f[6 + i, 12 + j] = -half[i, j] * dt
                f[3 + i, 12 + j] = -0.5 * dt * dt * half[i, j]
            for j in range(2):
                f[6 + i, 15 + j] = tilt[i, j] * dt
                f[3 + i, 15 + j] = 0.5 * dt * dt * tilt[i, j]
        p = f @ p @ f.T
        _grow(p, dt, rate, acceleration, imu[k : k + 2], noise)

        for i in range(3):
            position[i] += velocity[i] * dt + 0.5 * acceleration[i] * dt * dt
            velocity[i] += acceleration[i] * dt
        rotation = after
    _write(knots[count - 1], imu[count - 1, 0], rotation, position, velocity, acceleration, rate)
    out = state.copy()
    # Products of many rotations drift from orthogonal by 1e-16 each: one Gram-Schmidt step keeps it there.
    rotation = 1.5 * rotation - 0.5 * rotation @ rotation.T @ rotation
    for i in range(3):
        out[9 + i], out[12 + i] = position[i], velocity[i]
        for j in range(3):
            out[3 * i + j] = rotation[i, j]
    return out, 0.5 * (p + p.T), knots


@njit(cache=True, nogil=True)
def _write(
    knot: Doubles, t: float, rotation: Doubles, position: Doubles, velocity: Doubles, accel: Doubles, rate: Doubles
) -> None:
    knot[0] = t
    for i in range(3):
        for j in range(3):
            knot[1 + 3 * i + j] = rotation[i, j]
        knot[10 + i], knot[13 + i], knot[16 + i], knot[19 + i] = position[i], velocity[i], accel[i], rate[i]


@njit(cache=True, nogil=True)
def _grow(p: Doubles, dt: float, rate: Doubles, acceleration: Doubles, ends: Doubles, noise: Noise) -> None:
    """Adds the process noise of one step, between the samples `ends` (2, 7).

    Scale errors count as noise that stays for `CORRELATED_S`.
    """
    turning = rate[0] ** 2 + rate[1] ** 2 + rate[2] ** 2
    pushing = acceleration[0] ** 2 + acceleration[1] ** 2 + acceleration[2] ** 2
    gyro = noise.gyro_density**2 + noise.gyro_share**2 * turning * CORRELATED_S
    accel = noise.accel_density**2 + noise.accel_share**2 * pushing * CORRELATED_S
    for i in range(3):
        if max(abs(ends[0, 1 + i]), abs(ends[1, 1 + i])) > 0.99 * noise.gyro_range:
            gyro += SATURATED_GYRO**2
        if max(abs(ends[0, 4 + i]), abs(ends[1, 4 + i])) > 0.99 * noise.accel_range:
            accel += SATURATED_ACCEL**2
    if dt > noise.longest_step_s:
        gyro += GAP_GYRO**2
        accel += GAP_ACCEL**2
    for i in range(3):
        p[i, i] += gyro * dt
        p[3 + i, 3 + i] += accel * dt**3 / 3.0
        p[3 + i, 6 + i] += accel * dt**2 / 2.0
        p[6 + i, 3 + i] += accel * dt**2 / 2.0
        p[6 + i, 6 + i] += accel * dt
        p[9 + i, 9 + i] += noise.gyro_walk**2 * dt
        p[12 + i, 12 + i] += noise.accel_walk**2 * dt
    for i in range(15, 17):
        p[i, i] += noise.gravity_walk**2 * dt
