"""First yaw: planar weighted Kabsch with iterated Huber weights, from the antenna in `odom` and in `map`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimates import Array
from pipeline.gnss.belief import turned

ROUNDS = 10
HUBER = 2.0


@dataclass(frozen=True, slots=True)
class Alignment:
    """p_map = Rz(yaw) @ (p_odom - centre_odom_m) + centre_map_m. The two centres correspond.

    centre_variance_m2: (3,). yaw_sigma: rad, infinite where the way says nothing of it.
    """

    yaw: float
    yaw_sigma: float
    centre_odom_m: Array
    centre_map_m: Array
    centre_variance_m2: Array

    def to_map(self, odom_m: Array) -> Array:
        """(3,) in `map`."""
        return turned(self.yaw, odom_m - self.centre_odom_m) + self.centre_map_m

    def covariance_at(self, odom_m: Array) -> Array:
        """(4, 4) of x, y, z, yaw, of a point (3,) in `odom` taken to `map`."""
        arm = turned(self.yaw, odom_m - self.centre_odom_m)
        jacobian = np.eye(4)
        jacobian[0, 3], jacobian[1, 3] = -arm[1], arm[0]
        variances = np.array([*self.centre_variance_m2, self.yaw_sigma**2])
        return np.asarray(jacobian @ np.diag(variances) @ jacobian.T)


def align(odom_m: Array, map_m: Array, sigma_m: Array, share: Array) -> Alignment:
    """From n pairs (n, 3). sigma_m: (n, 3). share: (n,), how much of an independent fix each one is."""
    weights = np.ones(len(odom_m))
    information = share / (sigma_m[:, 0] * sigma_m[:, 1])
    for _ in range(ROUNDS):
        held = weights * information
        centre_odom, centre_map = _mean(odom_m, held), _mean(map_m, held)
        e, g = odom_m - centre_odom, map_m - centre_map
        sine = held @ (e[:, 0] * g[:, 1] - e[:, 1] * g[:, 0])
        cosine = held @ (e[:, 0] * g[:, 0] + e[:, 1] * g[:, 1])
        yaw = math.atan2(sine, cosine)
        rotated = np.column_stack(
            [math.cos(yaw) * e[:, 0] - math.sin(yaw) * e[:, 1], math.sin(yaw) * e[:, 0] + math.cos(yaw) * e[:, 1]]
        )
        size = np.linalg.norm((g[:, :2] - rotated) / sigma_m[:, :2], axis=1)
        # Dishonest sigmas: the residuals' own scale, where it is larger (1.18: median of a 2-D unit normal).
        scale = max(1.0, float(np.median(size)) / 1.18)
        weights = np.minimum(1.0, HUBER * scale / np.maximum(size, 1e-12))
    held = weights * information / scale**2
    moment = float(held @ (e[:, :2] ** 2).sum(axis=1))
    up = weights * share / (scale * sigma_m[:, 2]) ** 2
    centre_map[2] = centre_odom[2] + _median(map_m[:, 2] - odom_m[:, 2])
    variances = np.array([1.0 / held.sum(), 1.0 / held.sum(), 1.0 / up.sum()])
    return Alignment(yaw, moment**-0.5 if moment > 0.0 else math.inf, centre_odom, centre_map, variances)


def _mean(points: Array, weights: Array) -> Array:
    return np.asarray(weights @ points / weights.sum())


def _median(values: Array) -> float:
    return float(np.median(values))
