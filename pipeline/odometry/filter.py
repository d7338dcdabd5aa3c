"""The iterated error-state Kalman filter: propagation through inertial samples, update in information form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.odometry import so3
from pipeline.odometry.config import ImuConfig, MatchConfig
from pipeline.odometry.propagation_kernels import Noise, propagate
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.state import ATTITUDE, ERRORS, POSITION, State, gravity_axes

POSE = slice(0, 6)
TINY = 1e-6
SURPRISING = 9.0
"""Beyond this normalised square of an innovation the inertial samples are doubted. On sound walks of all carriers it is
0.5 in the median and never above 3.1, for the information of the scan is deflated."""
JUMP = np.concatenate([np.zeros(6), np.full(3, 0.02), np.full(3, 0.005), np.full(3, 0.05), np.zeros(2)])
"""Sigmas of speed and biases in the proportion in which they are doubted."""
MOST_DOUBT = 1e8


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
    surprise: float
    """Normalised square of the innovation, six degrees of freedom, before any widening of the prior."""


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """moved: from the prior to where the equations were taken, one step before `state`."""

    state: State
    information: Doubles
    equations: NormalEquations
    moved: Doubles
    step: Doubles
    iterations: int

    def surprise(self, covariance: Doubles) -> float:
        """Normalised square of the innovation under a prior covariance."""
        alone = np.linalg.inv(self.equations.information + TINY * np.eye(6))
        innovation = self.moved[POSE] - alone @ self.equations.gradient
        return float(innovation @ np.linalg.solve(covariance[POSE, POSE] + alone, innovation))


class Filter:
    """State and covariance (17, 17) of the error as `state` orders it.

    joined: begun on the way; the accelerometer counts for less at first.
    """

    def __init__(
        self, state: State, covariance: Doubles, imu: ImuConfig, match: MatchConfig, *, joined: bool = False
    ) -> None:
        self.state = state
        self.covariance = covariance
        self._imu = imu
        self._match = match
        self._begin = state, covariance, np.zeros((1, 7))
        self._noise = Noise(
            imu.gyro_density_rad_s,
            imu.accel_density_m_s2,
            imu.gyro_walk_rad_s,
            imu.accel_walk_m_s2,
            imu.gravity_walk_rad,
            imu.gyro_share,
            imu.accel_share,
            imu.gyro_range_rad_s,
            imu.accel_range_m_s2,
            imu.longest_step_s,
        )
        self._joined = self._noise._replace(accel_density=imu.joined_accel_density_m_s2)
        self._settles_s = imu.joined_s if joined else 0.0

    def propagate(self, samples: Doubles) -> Doubles:
        """Through samples (m, 7): time (s), rate, force. Gives the knots (m, KNOT) for deskewing."""
        self._begin = self.state, self.covariance, samples
        self._settles_s -= float(samples[-1, 0] - samples[0, 0])
        flat, self.covariance, knots = self._propagated(self.state, self.covariance, samples)
        self.state = State.from_flat(flat)
        return knots

    def update(
        self, match: Callable[[State, int], NormalEquations], more: int = 0, first: State | None = None
    ) -> Update:
        """Iterate to the state most likely under the prior and what `match` says of each guess (from iteration 1 on).

        more: iterations beyond the configured ones, not cut short. first: the first guess, the prior's mean otherwise.
        Where the scan is too surprising for the prior, the prior is widened until it is not.
        """
        found = self._iterate(match, more, first or self.state)
        surprise = found.surprise(self.covariance)
        if surprise > SURPRISING and found.equations.matches >= self._match.effective:
            self.covariance = self._doubted(found)
            found = self._iterate(match, more, found.state)
        covariance = np.linalg.inv(found.information)
        self.covariance = 0.5 * (covariance + covariance.T)
        self.state = found.state.clamped(self._imu.gyro_bias_limit_rad_s, self._imu.accel_bias_limit_m_s2)
        return Update(found.equations, found.iterations, float(np.linalg.norm(found.step[POSITION])), surprise)

    def _iterate(self, match: Callable[[State, int], NormalEquations], more: int, guess: State) -> _Solution:
        prior = self.state
        prior_information = np.linalg.inv(self.covariance)
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
        return _Solution(guess, information, equations, moved, step, iteration)

    def _still(self, step: Doubles) -> bool:
        turned, moved = np.abs(step[ATTITUDE]).max(), np.abs(step[POSITION]).max()
        return bool(turned < self._match.converged_rad and moved < self._match.converged_m)

    def _doubted(self, found: _Solution) -> Doubles:
        """The prior covariance, had speed and biases jumped at the start of the scan, by just enough."""
        state, before, samples = self._begin
        wide = before + np.diag(JUMP**2)
        growth = self._propagated(state, wide, samples)[1] - self.covariance
        scale, covariance = 1.0, self.covariance
        while scale < MOST_DOUBT and found.surprise(covariance) > SURPRISING:
            covariance = self.covariance + scale * growth
            scale *= 2.0
        return covariance

    def _propagated(self, state: State, covariance: Doubles, samples: Doubles) -> tuple[Doubles, Doubles, Doubles]:
        axes = gravity_axes(state.gravity_m_s2)
        noise = self._joined if self._settles_s > 0.0 else self._noise
        flat, grown, knots = propagate(state.flat(), covariance, axes, samples, noise)
        return np.asarray(flat), np.asarray(grown), np.asarray(knots)
