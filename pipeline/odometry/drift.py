"""Error that a map built by its own poses cannot see: it grows with the way travelled.

The filter's covariance is that of the pose within its map, and never grows. What is published adds the drift of the
map itself: yaw and position walk at random with distance, and a yaw error swings all that comes after it. Level ground
climbs or falls by the error of the vertical, which turns with the sensor as the accelerometer's bias does, and lasts.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.odometry import so3
from pipeline.odometry.config import DriftConfig
from pipeline.odometry.so3 import Doubles

NONE = np.empty((0, 3))


class Drift:
    """Covariance (4, 4) of yaw (rad) and position (m) of the map at the sensor, in `odom`."""

    def __init__(self, config: DriftConfig) -> None:
        self._config = config
        self._covariance: Doubles = np.zeros((4, 4))
        self._unseen_m = 0.0
        self._tilt, self._lean = 0.0, 0.0
        """Variance (rad^2) of the tilt as of the last step, and covariance (m rad) of the height with it."""

    def move(self, step_m: Doubles, factor: float = 1.0, weak: Doubles = NONE, tilt: float = 0.0) -> None:
        """The sensor moved by (3,) in `odom`. factor: widens the walk where the scan was no good.

        weak: rows (k, 3), directions that the scan did not show, as long (0 to 1) as it was followed there all the
        same: the error grows with the way itself. tilt: variance (rad^2) of the vertical about either axis.
        """
        length = float(np.linalg.norm(step_m))
        transition = np.eye(4)
        transition[1, 0], transition[2, 0] = -step_m[1], step_m[0]
        grown = transition @ self._covariance @ transition.T
        config = self._config
        # A share of the way that stays wrong over `correlated_m` is a walk of share^2 * correlated_m a metre.
        share = factor**2 * length * config.correlated_m
        grown[0, 0] += factor**2 * length * math.radians(config.yaw_deg_per_root_m) ** 2
        grown[1, 1] += share * config.horizontal**2
        grown[2, 2] += share * config.horizontal**2
        grown[3, 3] += share * config.vertical**2
        before_m, self._unseen_m = self._unseen_m, self._unseen_m + length if len(weak) else 0.0
        if len(weak):
            grown[1:, 1:] += config.weak**2 * (self._unseen_m**2 - before_m**2) * weak.T @ weak
        grown[3, 3] += self._climbed(length, tilt)
        self._covariance = grown

    def _climbed(self, length_m: float, tilt: float) -> float:
        """By how much the variance of the height grows over a step, `vertical` apart.

        The height errs with the tilt along the whole way (a Gauss-Markov process over `tilt_lasts_m`); as the tilt
        becomes known, what the two have in common shrinks as its variance does.
        """
        known = min(tilt / self._tilt, 1.0) if self._tilt > 0.0 else 0.0
        lean = self._lean * known * math.exp(-length_m / self._config.tilt_lasts_m)
        self._tilt, self._lean = tilt, lean + tilt * length_m
        return 2.0 * lean * length_m + tilt * length_m**2

    def widen(self, position_m: float, yaw_rad: float) -> None:
        """A break of the map: the new one hangs on the old one only so well."""
        self._covariance += np.diag([yaw_rad**2, position_m**2, position_m**2, position_m**2])

    def add_to(self, covariance: Doubles, rotation: Doubles) -> Doubles:
        """The pose covariance (6, 6), attitude in the body frame and position in `odom`, with the drift."""
        map_to_error = np.zeros((6, 4))
        map_to_error[:3, 0] = rotation.T[:, 2]
        map_to_error[3:, 1:] = np.eye(3)
        return covariance + map_to_error @ self._covariance @ map_to_error.T


def level(gravity: Doubles) -> Doubles:
    """The rotation (3, 3) that stands `odom` upright again, given gravity as the filter sees it in `odom`."""
    return np.asarray(so3.upright(-gravity))
