"""The iterated error-state Kalman filter: propagation through inertial samples, update in information form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.odometry import so3
from pipeline.odometry.config import ImuConfig, MatchConfig
from pipeline.odometry.propagation_kernels import propagate
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.state import ATTITUDE, ERRORS, POSITION, State, gravity_axes

POSE = slice(0, 6)


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """Information (6, 6) and gradient (6,) of attitude (body frame) and position: the scan alone would move by -A^-1 b.

    matches: residuals used. squared: their mean squared Mahalanobis distance. kept: share of weight left by Huber.
    """

    information: Doubles
    gradient: Doubles
    matches: int
    squared: float
    kept: float


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """What the last iteration of an update rested on."""

    equations: NormalEquations
    iterations: int
    step_m: float


class Filter:
    """State and covariance (17, 17) of the error as `state` orders it."""

    def __init__(self, state: State, covariance: Doubles, imu: ImuConfig, match: MatchConfig) -> None:
        self.state = state
        self.covariance = covariance
        self._imu = imu
        self._match = match
        self._noise = np.array(
            [
                imu.gyro_density_rad_s,
                imu.accel_density_m_s2,
                imu.gyro_walk_rad_s,
                imu.accel_walk_m_s2,
                imu.gyro_share,
                imu.accel_share,
                imu.gyro_range_rad_s,
                imu.accel_range_m_s2,
                imu.longest_step_s,
            ]
        )

    def propagate(self, samples: Doubles) -> Doubles:
        """Through samples (m, 7): time (s), rate, force. Gives the knots (m, KNOT) for deskewing."""
        axes = gravity_axes(self.state.gravity_m_s2)
        flat, self.covariance, knots = propagate(self.state.flat(), self.covariance, axes, samples, self._noise)
        self.state = State.from_flat(flat)
        return np.asarray(knots)

    def update(self, match: Callable[[State, int], NormalEquations], more: int = 0) -> Update:
        """Iterate to the state most likely under the prior and what `match` says of each guess (from iteration 1 on).

        more: iterations beyond the configured ones, not cut short.
        """
        prior, guess = self.state, self.state
        prior_information = np.linalg.inv(self.covariance)
        step: Doubles = np.zeros(ERRORS)
        iteration, equations = 0, None
        for iteration in range(1, self._match.iterations + more + 1):
            equations = match(guess, iteration)
            moved = guess.minus(prior)
            jacobian = np.eye(ERRORS)
            jacobian[ATTITUDE, ATTITUDE] = so3.right_jacobian_inverse(moved[ATTITUDE])
            pulled = jacobian.T @ prior_information
            information = pulled @ jacobian
            information[POSE, POSE] += equations.information
            gradient = pulled @ moved
            gradient[POSE] += equations.gradient
            step = np.asarray(-np.linalg.solve(information, gradient), dtype=np.float64)
            guess = guess.plus(step)
            if iteration > more and self._still(step):
                break
        assert equations is not None
        covariance = np.linalg.inv(information)
        self.covariance = 0.5 * (covariance + covariance.T)
        self.state = guess.clamped(self._imu.gyro_bias_limit_rad_s, self._imu.accel_bias_limit_m_s2)
        return Update(equations, iteration, float(np.linalg.norm(step[3:6])))

    def _still(self, step: Doubles) -> bool:
        turned, moved = np.abs(step[ATTITUDE]).max(), np.abs(step[POSITION]).max()
        return bool(turned < self._match.converged_rad and moved < self._match.converged_m)
