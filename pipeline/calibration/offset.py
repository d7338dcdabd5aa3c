"""By how much two clocks are apart, finely, from how two sensors on one body turned, and how sure that is.

After the rough lag (`lag`), each stretch of some seconds gives an offset of its own by Gauss-Newton on
a_i = R b(t_i + offset) + bias, where b is the gyroscope averaged over the very interval of a_i. A straight line through
the stretches (robust) is offset and drift; their scatter about it, not a model of the noise, is the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.calibration.lag import LEAST_OVERLAP_S, Lag, best_rotation, find_lag
from pipeline.calibration.turning import Angle, Array, Turning

STRETCH_S = 4.0
STEP_S = 0.002
LEAST_CORRELATION = 0.5
LEAST_AHEAD = 1.15
"""The best lag has to be so much better than any other."""
LEAST_TURNING_RAD_S = 0.04
LEAST_STRETCHES = 3
MOST_DRIFT = 3e-4
"""Crystals keep 1e-4; a recorder's stamps of a stream wander a little more."""
DRIFT_FROM_S = 120.0
"""Below this length the slope of the line says more about noise than about crystals, and is held at zero."""
WORST_STRETCH_S = 0.15
FLOOR_S = 1e-3
"""What the scatter does not show: on simulated walks offsets are 0.4 to 0.7 ms off, alike in all stretches."""


@dataclass(frozen=True, slots=True, eq=False)
class TimeOffset:
    """What happens at stamp t of the first happens at t + later_s + drift * (t - at_ns) by the second's stamps.

    sigma_s: of later_s, from the scatter of the stretches. rotation: (3, 3), second's axes to the first's. refusal: why
    it cannot be told, with what to do; empty: it can. Without, the numbers are still the best guess, for the curious.
    """

    later_s: float
    sigma_s: float
    drift: float
    at_ns: int
    correlation: float
    rival: float
    turning_rad_s: float
    stretches: int
    rotation: Array
    refusal: str = ""


def find_offset(
    first: Turning, second: Turning, least_s: float = -2.0, most_s: float = 2.0, overlap_s: float = LEAST_OVERLAP_S
) -> TimeOffset:
    """first: the camera; second: a gyroscope on the same body. CalibrationError when nothing can be compared."""
    lag = find_lag(first, second, least_s, most_s, overlap_s)
    angle = Angle(second)
    later_s, rotation = lag.later_s, lag.rotation
    for _ in range(3):
        rotation = _rotation(first, angle, later_s)
        later_s += _step(first, angle, later_s, rotation)[0]
    at, offsets, weights = _stretches(first, angle, later_s, rotation)
    origin_ns = int(first.begin_ns[0])
    centre_s = float(np.mean(at)) if len(at) else 0.0
    line = _line(at - centre_s, offsets, weights)
    return TimeOffset(
        later_s=line[0] if len(at) else later_s,
        sigma_s=line[2],
        drift=line[1],
        at_ns=origin_ns + round(centre_s * 1e9),
        correlation=_correlation(first, angle, line[0] if len(at) else later_s, rotation),
        rival=lag.rival,
        turning_rad_s=first.rms_rad_s,
        stretches=len(at),
        rotation=rotation,
        refusal=_refusal(first, lag, len(at), line[2], (least_s, most_s)),
    )


def _refusal(first: Turning, lag: Lag, stretches: int, sigma_s: float, allowed: tuple[float, float]) -> str:
    if first.rms_rad_s < LEAST_TURNING_RAD_S:
        return (
            f"hardly any turning ({np.degrees(first.rms_rad_s):.1f} deg/s): turn the payload by hand, about all axes, "
            "for half a minute"
        )
    if lag.correlation < LEAST_CORRELATION:
        return (
            f"the two do not turn alike at any offset from {allowed[0]:g} to {allowed[1]:g} s (correlation "
            f"{lag.correlation:.2f}): were they fixed to each other, and recorded at the same time?"
        )
    if lag.correlation < LEAST_AHEAD * lag.rival:
        return (
            f"two offsets fit nearly as well (correlation {lag.correlation:.2f} and {lag.rival:.2f}): the motion "
            "repeats itself; turn the payload irregularly"
        )
    if stretches < LEAST_STRETCHES:
        return f"only {stretches} stretches of {STRETCH_S:g} s with enough turning: record for half a minute and more"
    if not sigma_s < 0.02:
        return f"the stretches disagree by {1e3 * sigma_s:.0f} ms: one of the clocks jumps, or frames are missing"
    return ""


def _paired(first: Turning, angle: Angle, later_s: float) -> tuple[Array, Array]:
    """Rates (n, 3) of both where both have data, without their means."""
    there = angle.covers(first.begin_ns, first.end_ns, later_s)
    own = first.rate[there]
    other = angle.mean_rate(first.begin_ns[there], first.end_ns[there], later_s)
    return own - np.median(own, axis=0), other - np.median(other, axis=0)


def _rotation(first: Turning, angle: Angle, later_s: float) -> Array:
    own, other = _paired(first, angle, later_s)
    rotation = best_rotation(own, other)
    for _ in range(3):
        weight = _weights(np.linalg.norm(own - other @ rotation.T, axis=1))[:, None]
        rotation = best_rotation(own * weight, other)
    return rotation


def _correlation(first: Turning, angle: Angle, later_s: float, rotation: Array) -> float:
    own, other = _paired(first, angle, later_s)
    length = np.sqrt(np.sum(own**2) * np.sum(other**2))
    return float(np.sum(own * (other @ rotation.T)) / max(length, 1e-12))


def _step(first: Turning, angle: Angle, later_s: float, rotation: Array) -> tuple[float, float]:
    """What to add to later_s, iterated to rest, and the information in it: the sum of squared accelerations."""
    begin, end, added, information = first.begin_ns, first.end_ns, 0.0, 0.0
    for _ in range(8):
        at = later_s + added
        there = angle.covers(begin, end, at - STEP_S) & angle.covers(begin, end, at + STEP_S)
        if there.sum() < 10:
            return added, 0.0
        sides = [angle.mean_rate(begin[there], end[there], at + s) @ rotation.T for s in (-STEP_S, 0.0, STEP_S)]
        slope = (sides[2] - sides[0]) / (2.0 * STEP_S)
        slope = slope - slope.mean(axis=0)
        left = first.rate[there] - sides[1]
        left = left - np.median(left, axis=0)
        weight = _weights(np.linalg.norm(left, axis=1))[:, None]
        information = float(np.sum(weight * slope**2))
        move = float(np.sum(weight * slope * left)) / max(information, 1e-12)
        added += float(np.clip(move, -0.03, 0.03))
        if abs(move) < 1e-6:
            break
    return added, information


def _stretches(first: Turning, angle: Angle, later_s: float, rotation: Array) -> tuple[Array, Array, Array]:
    """Middle (s after the start), offset (s) and information of each stretch that has any."""
    origin_ns = int(first.begin_ns[0])
    length_ns = round(STRETCH_S * 1e9)
    rows = []
    for begin_ns in range(origin_ns, int(first.end_ns[-1]) - length_ns // 2, length_ns):
        part = first.within(begin_ns, begin_ns + length_ns)
        if len(part) < 20 or part.rms_rad_s < 0.5 * LEAST_TURNING_RAD_S:
            continue
        added, information = _step(part, angle, later_s, rotation)
        if information > 0 and abs(added) < WORST_STRETCH_S:
            rows.append(((float(np.mean(part.middle_ns - origin_ns))) * 1e-9, later_s + added, information))
    table = np.array(rows).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def _line(at_s: Array, offsets: Array, information: Array) -> tuple[float, float, float]:
    """Value at 0, slope, and sigma of the value."""
    if not len(at_s):
        return 0.0, 0.0, np.inf
    sloped = np.ptp(at_s) > DRIFT_FROM_S
    design = np.column_stack([np.ones_like(at_s), at_s]) if sloped else np.ones((len(at_s), 1))
    base, found = np.sqrt(information / information.max()), np.zeros(design.shape[1])
    weight = base
    for _ in range(10):
        found = np.linalg.lstsq(design * weight[:, None], offsets * weight, rcond=None)[0]
        weight = base * np.sqrt(_weights(base * (offsets - design @ found)))
    left = offsets - design @ found
    freedom = len(at_s) - design.shape[1]
    if freedom < 1:
        return float(found[0]), float(found[1]) if sloped else 0.0, np.inf
    spread = float(np.sum((weight * left) ** 2)) / freedom
    covariance = spread * np.linalg.inv((design * weight[:, None] ** 2).T @ design)
    slope = float(np.clip(found[1], -MOST_DRIFT, MOST_DRIFT)) if sloped else 0.0
    return float(found[0]), slope, float(np.hypot(np.sqrt(covariance[0, 0]), FLOOR_S))


def _weights(residual: Array) -> Array:
    """Cauchy's, with the scale taken from the median."""
    scale = 2.5 * max(float(np.median(np.abs(residual))), 1e-9)
    return np.asarray(1.0 / (1.0 + (residual / scale) ** 2))
