"""The state of the filter and its 17-dimensional error.

Error order: attitude (body frame), position, velocity, gyro bias, accelerometer bias, gravity (two angles on S2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.odometry import so3
from pipeline.odometry.so3 import Doubles

ATTITUDE, POSITION, VELOCITY = slice(0, 3), slice(3, 6), slice(6, 9)
GYRO_BIAS, ACCEL_BIAS, GRAVITY = slice(9, 12), slice(12, 15), slice(15, 17)
ERRORS = 17
GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Of `base_link` in `odom`. rotation (3, 3) body to odom; all else (3,), SI units; gravity_m_s2 points down."""

    rotation: Doubles
    position_m: Doubles
    velocity_m_s: Doubles
    gyro_bias: Doubles
    accel_bias: Doubles
    gravity_m_s2: Doubles

    def plus(self, error: Doubles) -> State:
        """The state moved by an error (17,)."""
        return State(
            self.rotation @ so3.exp(error[ATTITUDE]),
            self.position_m + error[POSITION],
            self.velocity_m_s + error[VELOCITY],
            self.gyro_bias + error[GYRO_BIAS],
            self.accel_bias + error[ACCEL_BIAS],
            so3.exp(gravity_axes(self.gravity_m_s2) @ error[GRAVITY]) @ self.gravity_m_s2,
        )

    def minus(self, other: State) -> Doubles:
        """The error (17,) that moves `other` here."""
        axes = gravity_axes(other.gravity_m_s2)
        turn = so3.cross(other.gravity_m_s2, self.gravity_m_s2) / (other.gravity_m_s2 @ other.gravity_m_s2)
        return np.concatenate(
            [
                so3.log(other.rotation.T @ self.rotation),
                self.position_m - other.position_m,
                self.velocity_m_s - other.velocity_m_s,
                self.gyro_bias - other.gyro_bias,
                self.accel_bias - other.accel_bias,
                axes.T @ turn,
            ]
        )

    def flat(self) -> Doubles:
        """All of it as (24,), for the kernels."""
        return np.concatenate(
            [
                self.rotation.ravel(),
                self.position_m,
                self.velocity_m_s,
                self.gyro_bias,
                self.accel_bias,
                self.gravity_m_s2,
            ]
        )

    @classmethod
    def from_flat(cls, flat: Doubles) -> State:
        """From what `flat` gave."""
        return cls(
            flat[:9].reshape(3, 3).copy(),
            flat[9:12].copy(),
            flat[12:15].copy(),
            flat[15:18].copy(),
            flat[18:21].copy(),
            flat[21:24].copy(),
        )

    def clamped(self, gyro_limit: float, accel_limit: float) -> State:
        """With biases within what the sensor can have."""
        return replace(
            self,
            gyro_bias=np.clip(self.gyro_bias, -gyro_limit, gyro_limit),
            accel_bias=np.clip(self.accel_bias, -accel_limit, accel_limit),
        )


def gravity_axes(gravity: Doubles) -> Doubles:
    """Two axes (3, 2) across gravity, smooth around straight down. Gravity never leaves that half: `odom` is level."""
    return np.asarray(so3.across(gravity))
