"""The inertial sensor of the simulated Mid-360: the trajectory's derivatives through an ICM-40609-class sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.sim.scene import Doubles
from drivers.sim.trajectory import Trajectory

GRAVITY_M_S2 = 9.80665
DRAWS = 512


@dataclass(frozen=True, slots=True)
class ImuConfig:
    """Densities are a root hertz, walks a root second; each sample takes in noise of `bandwidth_hz`.

    Data sheet of the ICM-40609: 4.5 mdps and 100 micro-g a root hertz. Biases are those left by the factory's trim.
    """

    gyro_density_rad_s: float = math.radians(4.5e-3)
    accel_density_g: float = 100e-6
    bandwidth_hz: float = 100.0
    gyro_bias_rad_s: float = math.radians(0.2)
    accel_bias_g: float = 8e-3
    gyro_walk_rad_s: float = 2e-5
    accel_walk_g: float = 2e-5
    scale_error: float = 2e-3
    misalignment_rad: float = 1e-3
    gyro_range_rad_s: float = math.radians(2000.0)
    accel_range_g: float = 4.0


PERFECT = ImuConfig(
    gyro_density_rad_s=0.0,
    accel_density_g=0.0,
    gyro_bias_rad_s=0.0,
    accel_bias_g=0.0,
    gyro_walk_rad_s=0.0,
    accel_walk_g=0.0,
    scale_error=0.0,
    misalignment_rad=0.0,
)


class Imu:
    """An `ImuSource`. Not thread-safe; times must not go back, for the biases walk."""

    def __init__(self, trajectory: Trajectory, config: ImuConfig, seed: int) -> None:
        self._trajectory = trajectory
        self._config = config
        self._rng = np.random.default_rng([seed, 71])
        self._gyro_matrix = self._mixing()
        self._accel_matrix = self._mixing()
        self._bias: Doubles = self._rng.normal(size=6) * np.repeat([config.gyro_bias_rad_s, config.accel_bias_g], 3)
        self._walk = np.repeat([config.gyro_walk_rad_s, config.accel_walk_g], 3)
        white = [config.gyro_density_rad_s, config.accel_density_g]
        self._white = np.repeat(white, 3) * math.sqrt(config.bandwidth_hz)
        self._range = np.repeat([config.gyro_range_rad_s, config.accel_range_g], 3)
        self._last_ns = 0
        self._draws: Doubles = np.empty((0, 12))
        self._used = 0

    def sample(self, t_ns: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Angular velocity (rad/s) and specific force (g), saturated, in `base_link`."""
        motion = self._trajectory.at(t_ns)
        force = motion.rotation[0].T @ (motion.acceleration_m_s2[0] + (0.0, 0.0, GRAVITY_M_S2)) / GRAVITY_M_S2
        normal = self._normal()
        self._bias = self._bias + self._walk * math.sqrt(max(t_ns - self._last_ns, 0) * 1e-9) * normal[:6]
        self._last_ns = t_ns
        true = np.concatenate([self._gyro_matrix @ motion.angular_velocity[0], self._accel_matrix @ force])
        reading = np.clip(true + self._bias + self._white * normal[6:], -self._range, self._range)
        wx, wy, wz, fx, fy, fz = reading.tolist()
        return (wx, wy, wz), (fx, fy, fz)

    def bias(self) -> Doubles:
        """The biases as they stand: gyro (rad/s), then accelerometer (g), (6,). For the truth only."""
        return self._bias.copy()

    def _mixing(self) -> Doubles:
        """Scale errors on the diagonal, misalignment off it."""
        off: Doubles = self._config.misalignment_rad * self._rng.normal(size=(3, 3))
        np.fill_diagonal(off, 1.0 + self._config.scale_error * self._rng.normal(size=3))
        return off

    def _normal(self) -> Doubles:
        if self._used == len(self._draws):
            self._draws = self._rng.normal(size=(DRAWS, 12))
            self._used = 0
        self._used += 1
        draw: Doubles = self._draws[self._used - 1]
        return draw
