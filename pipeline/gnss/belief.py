"""The small filter: the antenna in `map`, the yaw of `odom`, and the lasting part of the receiver's error.

State (13,): x, y, z (m) of the antenna in `map`; yaw (rad) of `odom` in `map`; the receiver's lasting error east, north,
up (m), a Gauss-Markov process, for each kind of solution: fixed, float, other. Odometry moves the antenna; its drift is
noise by the metre. Seen from the current place, not from the origin of `odom`, a drift in yaw does not throw the
position about.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimates import Array
from pipeline.gnss.config import FusionConfig

SIZE = 13
DIAGONAL = (range(SIZE), range(SIZE))
YAW = 3
HORIZONTAL, UP = slice(0, 2), slice(2, 3)
AXES = (HORIZONTAL, UP)
HUBER_RATIO = (1.5, 1.0)
GATE_RATIO = (1.0, 0.78)
"""Of the horizontal and the vertical part: 10.8 and 13.8 are the 99.9 % of one and two degrees of freedom."""


@dataclass(frozen=True, slots=True)
class Belief:
    """mean (13,), covariance (13, 13)."""

    mean: Array
    covariance: Array


@dataclass(frozen=True, slots=True)
class Observation:
    """A fix in `map` (3,) with the sigmas (3,) given to it. kind: which lasting error is in it, 0..2."""

    position_m: Array
    sigma_m: Array
    kind: int


def turned(yaw: float, vector: Array) -> Array:
    """Rz(yaw) @ vector."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    x, y, z = vector
    return np.array([cosine * x - sine * y, sine * x + cosine * y, z])


def started(position_m: Array, yaw: float, covariance: Array, lasting_m: Array) -> Belief:
    """From an alignment: covariance (4, 4) of x, y, z, yaw. lasting_m: (9,) sigmas of the lasting errors."""
    full = np.diag([*np.zeros(4), *lasting_m**2])
    full[:4, :4] = covariance
    return Belief(np.array([*position_m, yaw, *np.zeros(9)]), full)


def moved(
    belief: Belief, step_m: Array, drift_way_m: float, passed_s: float, lasting_m: Array, config: FusionConfig
) -> tuple[Belief, Array]:
    """After the odometry moved the antenna by `step_m` (3,) in `odom`; and the transition (13, 13)."""
    mean = belief.mean.copy()
    step = turned(float(mean[YAW]), step_m)
    keep = math.exp(-passed_s / config.correlation_s) if config.correlation_s else 0.0
    mean[:3] += step
    mean[4:] *= keep
    transition = np.diag([1.0, 1.0, 1.0, 1.0, *[keep] * 9])
    transition[0, YAW], transition[1, YAW] = -step[1], step[0]
    covariance = transition @ belief.covariance @ transition.T
    covariance[DIAGONAL] += np.concatenate([drift(config) * drift_way_m, (1.0 - keep**2) * lasting_m**2])
    return Belief(mean, covariance), transition


def drift(config: FusionConfig) -> Array:
    """(4,) variance of x, y, z, yaw a metre."""
    sigma = (config.drift_m, config.drift_m, config.drift_up_m, math.radians(config.drift_yaw_deg))
    return np.array(sigma) ** 2


def design(seen: Observation, config: FusionConfig) -> tuple[Array, Array]:
    """Jacobian (3, 13) of a fix, and the variances (3,) of its white part."""
    jacobian = np.zeros((3, SIZE))
    jacobian[range(3), range(3)] = 1.0
    jacobian[range(3), range(4 + 3 * seen.kind, 7 + 3 * seen.kind)] = 1.0
    white = config.white_share if config.correlation_s else 1.0
    return jacobian, (white * seen.sigma_m) ** 2


def innovation_chi2(belief: Belief, seen: Observation, config: FusionConfig) -> tuple[float, float]:
    """Normalised innovation squared, horizontal (2 degrees of freedom) and vertical (1)."""
    jacobian, white = design(seen, config)
    innovation = seen.position_m - jacobian @ belief.mean
    spread = jacobian @ belief.covariance @ jacobian.T + np.diag(white)
    horizontal, up = (float(innovation[axes] @ np.linalg.solve(spread[axes, axes], innovation[axes])) for axes in AXES)
    return horizontal, up


def corrected(belief: Belief, seen: Observation, weights: Array, config: FusionConfig) -> Belief:
    """With a fix whose information is multiplied by `weights` (3,); 0 leaves an axis out. Joseph form."""
    jacobian, white = design(seen, config)
    used = weights > 0.0
    if not used.any():
        return belief
    jacobian, noise = jacobian[used], np.diag(white[used] / weights[used])
    spread = jacobian @ belief.covariance @ jacobian.T + noise
    gain = np.linalg.solve(spread, jacobian @ belief.covariance).T
    left = np.eye(SIZE) - gain @ jacobian
    mean = belief.mean + gain @ (seen.position_m[used] - jacobian @ belief.mean)
    return Belief(mean, left @ belief.covariance @ left.T + gain @ noise @ gain.T)


def huber_weights(belief: Belief, seen: Observation, config: FusionConfig) -> Array:
    """(3,) weights by the whitened residual of a belief that has seen the fix; horizontal and vertical apart."""
    jacobian, white = design(seen, config)
    residual = (seen.position_m - jacobian @ belief.mean) / np.sqrt(white)
    weights = np.ones(3)
    for axes, ratio in zip(AXES, HUBER_RATIO, strict=True):
        size = float(np.linalg.norm(residual[axes]))
        weights[axes] = min(1.0, ratio * config.huber / size) if size > 0.0 else 1.0
    return weights


def robustly_corrected(belief: Belief, seen: Observation, allowed: Array, config: FusionConfig, rounds: int = 4) -> Belief:
    """Iteratively reweighted: Huber loss on the fix, squared on the prior. allowed: (3,) 1 or 0 by axis."""
    after = corrected(belief, seen, allowed, config)
    if math.isinf(config.huber):
        return after
    for _ in range(rounds):
        weights = huber_weights(after, seen, config)
        if weights.min() == 1.0:
            break
        after = corrected(belief, seen, allowed * weights, config)
    return after
