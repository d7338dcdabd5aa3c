"""Where the odometry saw the antenna lately, so that a fix is compared with its own instant however late it comes."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from pipeline.estimates import Array, OdometryEstimate
from pipeline.gnss.config import FusionConfig

GAP_NS = 500_000_000
"""Longer between two estimates, the odometry had a gap and what lies in it is not known."""


@dataclass(frozen=True, slots=True)
class Passage:
    """The antenna (3,) in `odom`. drift_way_m: the way that counts for drift, longer where the odometry was weak."""

    stamp_ns: int
    antenna_m: Array
    drift_way_m: float


class History:
    """The passages of the last seconds."""

    def __init__(self, config: FusionConfig) -> None:
        self._config = config
        self._passages: list[Passage] = []
        self._travelled_m = 0.0

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the last estimate."""
        return self._passages[-1].stamp_ns if self._passages else None

    def add(self, estimate: OdometryEstimate) -> bool:
        """In order of time; others are left out. False when the odometry began anew, and with it the history."""
        if self._passages and estimate.stamp_ns <= self._passages[-1].stamp_ns:
            return True
        anew = estimate.travelled_m < self._travelled_m
        if anew:
            self._passages.clear()
        antenna = antenna_m(estimate, self._config)
        last = self._passages[-1] if self._passages else None
        way = 0.0
        if last is not None:
            weak = estimate.degenerate or estimate.stamp_ns - last.stamp_ns > GAP_NS
            stretch = self._config.degenerate_factor**2 if weak else 1.0
            way = last.drift_way_m + stretch * max(estimate.travelled_m - self._travelled_m, 0.0)
        self._travelled_m = estimate.travelled_m
        self._passages.append(Passage(estimate.stamp_ns, antenna, way))
        if estimate.stamp_ns - self._passages[0].stamp_ns > 2e9 * self._config.history_s:
            oldest_ns = estimate.stamp_ns - int(1e9 * self._config.history_s)
            del self._passages[: bisect_left(self._passages, oldest_ns, key=_stamp)]
        return not anew

    def at(self, stamp_ns: int) -> Passage | None:
        """Between two estimates; None outside of what is known."""
        after = bisect_left(self._passages, stamp_ns, key=_stamp)
        if after == len(self._passages) or (after == 0 and self._passages[0].stamp_ns != stamp_ns):
            return None
        b = self._passages[after]
        if b.stamp_ns == stamp_ns:
            return b
        a = self._passages[after - 1]
        if b.stamp_ns - a.stamp_ns > GAP_NS:
            return None
        share = (stamp_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
        antenna = a.antenna_m + share * (b.antenna_m - a.antenna_m)
        return Passage(stamp_ns, antenna, a.drift_way_m + share * (b.drift_way_m - a.drift_way_m))


def antenna_m(estimate: OdometryEstimate, config: FusionConfig) -> Array:
    """(3,) of the antenna in `odom`."""
    return np.asarray(estimate.position_m + estimate.rotation @ np.array(config.antenna_m))


def _stamp(passage: Passage) -> int:
    return passage.stamp_ns
