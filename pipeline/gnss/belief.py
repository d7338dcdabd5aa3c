"""The small filter: the antenna in `map`, the yaw of `odom`, and the lasting part of the receiver's error.

State (13,): x, y, z (m) of the antenna in `map`; yaw (rad) of `odom` in `map`; the receiver's lasting error east,
north, up (m), a Gauss-Markov process, for each kind of solution: fixed, float, other. Odometry moves the antenna; its
drift is noise by the metre. Seen from the current place, not from the origin of `odom`, a drift in yaw does not throw
the position about. Plain numpy: filterpy would bring matplotlib and 0.9 s of import for two matrix lines.
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
"""Of the horizontal and the vertical part: 13.8 and 10.8 are the 99.9 % of two degrees of freedom and of one."""


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


def moved(belief: Belief, step_m: Array, drifted: Array, keep: float, lasting_m: Array) -> tuple[Belief, Array]:
    """After the odometry moved the antenna by `step_m` (3,) in `odom`; and the transition (13, 13).

    drifted: (4,) variance of x, y, z, yaw gathered. keep: share of the lasting errors that lasted; lasting_m: (9,).
    """
    mean = belief.mean.copy()
    step = turned(float(mean[YAW]), step_m)
    mean[:3] += step
    mean[4:] *= keep
    transition = np.diag([1.0, 1.0, 1.0, 1.0, *[keep] * 9])
    transition[0, YAW], transition[1, YAW] = -step[1], step[0]
    covariance = transition @ belief.covariance @ transition.T
    covariance[DIAGONAL] += np.concatenate([drifted, (1.0 - keep**2) * lasting_m**2])
    return Belief(mean, covariance), transition


def design(seen: Observation, config: FusionConfig) -> tuple[Array, Array]:
    """Jacobian (3, 13) of a fix, and the variances (3,) of its white part."""
    jacobian = np.zeros((3, SIZE))
    jacobian[range(3), range(3)] = 1.0
    jacobian[range(3), range(4 + 3 * seen.kind, 7 + 3 * seen.kind)] = 1.0
    white = config.white_share if config.correlation_s else 1.0
    return jacobian, (white * seen.sigma_m) ** 2


@dataclass(frozen=True, slots=True)
class Innovation:
    """Of a fix: value (3,), covariance (3, 3), Jacobian (3, 13), variances (3,) of the white part.

    chi2: normalised square, horizontal (2 degrees of freedom) and vertical (1).
    """

    value: Array
    covariance: Array
    jacobian: Array
    white: Array
    chi2: tuple[float, float]


def innovation(belief: Belief, seen: Observation, config: FusionConfig) -> Innovation:
    """What the belief did not expect of a fix."""
    jacobian, white = design(seen, config)
    value = seen.position_m - jacobian @ belief.mean
    spread = jacobian @ belief.covariance @ jacobian.T
    spread[range(3), range(3)] += white
    (a, b), (_, c) = spread[0, :2], spread[1, :2]
    x, y, z = value
    horizontal = (c * x * x - 2.0 * b * x * y + a * y * y) / (a * c - b * b)
    return Innovation(value, spread, jacobian, white, (float(horizontal), float(z * z / spread[2, 2])))


def huber_weights(chi2: tuple[float, float], config: FusionConfig) -> Array:
    """(3,) from the whitened innovation, horizontal and vertical apart."""
    horizontal, up = (
        min(1.0, ratio * config.huber / math.sqrt(value)) if value > 0.0 else 1.0
        for ratio, value in zip(HUBER_RATIO, chi2, strict=True)
    )
    return np.array([horizontal, horizontal, up])


def log_likelihood(new: Innovation, config: FusionConfig) -> float:
    """Of an innovation, but for a constant; no less than at the gate, so that outliers do not decide."""
    spread = new.covariance
    horizontal = float(np.log(spread[0, 0] * spread[1, 1] - spread[0, 1] ** 2)) + min(new.chi2[0], config.gate)
    return -0.5 * (horizontal + math.log(spread[2, 2]) + min(new.chi2[1], GATE_RATIO[1] * config.gate))


def corrected(belief: Belief, new: Innovation, weights: Array) -> Belief:
    """Moved by `weights` (3,) of what a squared loss would move it: the innovation's covariance over the weight.

    Joseph form. The weight acts on the whole innovation: acting on the white part alone, the lasting error
    would take up what the fix is off.
    """
    noise = new.white + np.diag(new.covariance) * (1.0 / weights - 1.0)
    spread = new.covariance + np.diag(noise - new.white)
    gain = np.linalg.solve(spread, new.jacobian @ belief.covariance).T
    left = np.eye(SIZE) - gain @ new.jacobian
    return Belief(belief.mean + gain @ new.value, left @ belief.covariance @ left.T + (gain * noise) @ gain.T)
