"""How far a fix is believed: its reported sigma, floored by quality, times a scale learned from the innovations."""

from __future__ import annotations

import math

import numpy as np

from drivers.messages import FixQuality, GnssFix
from pipeline.estimates import Array
from pipeline.gnss.belief import Observation
from pipeline.gnss.config import FusionConfig

MEDIAN_CHI2 = 2.0 * math.log(2.0)
"""Of chi-square with two degrees of freedom."""
KINDS = {FixQuality.RTK_FIXED: 0, FixQuality.RTK_FLOAT: 1}
OTHER = 2
"""Kinds of solution, as their errors go: whatever is not carrier phase."""
UNUSABLE = (FixQuality.INVALID, FixQuality.DEAD_RECKONING, FixQuality.MANUAL, FixQuality.SIMULATOR)


class Trust:
    """One scale a kind, never below 1: a receiver that understates itself by chance is not believed more."""

    def __init__(self, config: FusionConfig) -> None:
        self._config = config
        self._scale = [1.0] * 3
        self._learned_ns = [0] * 3
        floor = np.array(config.sigma_floor_m)
        self.lasting_m = np.column_stack([floor, floor, config.vertical_ratio * floor]).ravel()
        """(9,) sigmas last seen, kind by kind."""

    def scale(self, quality: FixQuality) -> float:
        """By how much the sigmas of this quality are multiplied."""
        return self._scale[KINDS.get(quality, OTHER)]

    def observation(self, position_m: Array, floored_m: Array, quality: FixQuality) -> Observation:
        """A fix (3,) with reported sigmas (3,)."""
        kind = KINDS.get(quality, OTHER)
        sigma = self._scale[kind] * floored_m
        white = self._config.white_share if self._config.correlation_s else 1.0
        self.lasting_m[3 * kind : 3 * kind + 3] = math.sqrt(max(1.0 - white**2, 1e-6)) * sigma
        return Observation(position_m, sigma, kind)

    def learn(self, kind: int, stamp_ns: int, chi2: float) -> None:
        """From a horizontal innovation. Its side of the median, not its size: an outlier counts as one."""
        passed_s = (stamp_ns - self._learned_ns[kind]) / 1e9
        self._learned_ns[kind] = stamp_ns
        step = self._config.learning_rate * min(max(passed_s, 0.0), 1.0) * (1.0 if chi2 > MEDIAN_CHI2 else -1.0)
        self._scale[kind] = min(max(self._scale[kind] * math.exp(step), 1.0), self._config.most_dishonest)


def usable(fix: GnssFix) -> bool:
    """Whether the receiver claims a position measured by satellites."""
    values = (fix.latitude_deg, fix.longitude_deg, fix.height_m, *fix.sigma_enu_m)
    return fix.quality not in UNUSABLE and all(map(math.isfinite, values)) and min(fix.sigma_enu_m) > 0.0


def floored_m(fix: GnssFix, config: FusionConfig) -> Array:
    """(3,) reported sigmas, or what that quality achieves at best."""
    if config.constant_sigma_m:
        return np.full(3, config.constant_sigma_m)
    floor = config.sigma_floor_m[KINDS.get(fix.quality, OTHER)]
    return np.maximum(fix.sigma_enu_m, [floor, floor, config.vertical_ratio * floor])
