"""How many points a sweep may have so that the pipeline keeps up: fewer on a slow or hot computer, never later.

Thinning first; sweeps are left out only when even the thinnest are too many, and their inertial data never are.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from drivers.messages import LidarScan
from edge.replay.pairing import Sweep
from pipeline.products.tiles import RETRO

LEAST_SHARE = 0.1
BUSY, EASY = 0.75, 0.5
"""Share of the time between sweeps that is spent on one: above, points are taken away; below, given back."""
MOST_WAITING = 3
"""Sweeps that may wait; older ones are left out."""
_DOWN, _UP = 0.8, 1.05
_SMOOTHING = 0.2


class Governor:
    """Queues sweeps and decides. Not thread-safe."""

    def __init__(self, period_s: float = 0.1) -> None:
        self.share = 1.0
        """Of the points of a sweep that are used."""
        self.dropped = 0
        """Sweeps left out."""
        self.load = 0.0
        """Smoothed share of the time between sweeps that one takes."""
        self._period_s = period_s
        self._waiting: deque[Sweep] = deque()
        self._last_ns: int | None = None

    @property
    def waiting(self) -> int:
        """Sweeps that wait."""
        return len(self._waiting)

    def add(self, sweep: Sweep) -> None:
        """Queue a sweep. The oldest is left out when too many wait; its inertial data go to the one after it."""
        self._learn_period(sweep.scan.stamp_ns)
        self._waiting.append(sweep)
        while len(self._waiting) > MOST_WAITING:
            left = self._waiting.popleft()
            self._waiting[0] = replace(self._waiting[0], imu=(*left.imu, *self._waiting[0].imu))
            self.dropped += 1

    def next(self) -> Sweep | None:
        """The oldest that waits, thinned; None when none does."""
        if not self._waiting:
            return None
        sweep = self._waiting.popleft()
        return sweep if self.share >= 1.0 else replace(sweep, scan=thinned(sweep.scan, self.share))

    def took(self, seconds: float) -> None:
        """How long the last sweep took."""
        load = seconds / self._period_s
        self.load += _SMOOTHING * (load - self.load)
        if self.load > BUSY or self._waiting:
            self.share = max(LEAST_SHARE, self.share * _DOWN)
        elif self.load < EASY:
            self.share = min(1.0, self.share * _UP)

    def _learn_period(self, stamp_ns: int) -> None:
        if self._last_ns is not None and 0 < stamp_ns - self._last_ns < 500_000_000:
            self._period_s += _SMOOTHING * ((stamp_ns - self._last_ns) / 1e9 - self._period_s)
        self._last_ns = stamp_ns


def thinned(scan: LidarScan, share: float) -> LidarScan:
    """Evenly in time, and so over the field of view; retro-reflectors stay."""
    count = len(scan.xyz_m)
    kept = np.zeros(count, bool)
    kept[np.linspace(0, count - 1, max(1, int(count * share))).astype(int) if count else []] = True
    kept |= scan.reflectivity >= RETRO
    return LidarScan(
        scan.stamp_ns,
        scan.receive_ns,
        scan.xyz_m[kept],
        scan.reflectivity[kept],
        scan.tag[kept],
        scan.line[kept],
        scan.offset_ns[kept],
    )
