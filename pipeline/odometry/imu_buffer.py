"""Inertial samples in order of time, however they came in, and the stretches of them that a scan needs."""

from __future__ import annotations

import bisect

import numpy as np

from drivers.messages import ImuSample
from pipeline.odometry.so3 import Doubles

HELD_S = 60.0
"""Longest that is kept while nothing is taken."""


class ImuBuffer:
    """Sorted by stamp. Not thread-safe."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._rows: list[tuple[float, ...]] = []
        self._taken_ns = -1
        self.late = 0
        """Samples that came after their time had been used, or twice, and were left out."""

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest sample, -1 when there is none."""
        return self._stamps[-1] if self._stamps else -1

    def add(self, sample: ImuSample) -> None:
        """Put a sample in its place. Not finite, too late or doubled: counted, left out."""
        row = (*sample.angular_velocity, *sample.linear_acceleration)
        stamp = sample.stamp_ns
        at = len(self._stamps) if stamp > self.newest_ns else bisect.bisect_left(self._stamps, stamp)
        double = at < len(self._stamps) and self._stamps[at] == stamp
        if double or stamp <= self._taken_ns or not np.isfinite(row).all():
            self.late += 1
            return
        self._stamps.insert(at, stamp)
        self._rows.insert(at, row)
        if self._stamps[-1] - self._stamps[0] > HELD_S * 1e9:
            self._forget(self._stamps[-1] - int(HELD_S * 1e9))

    def window(self, begin_ns: int, end_ns: int) -> Doubles:
        """What lies within, as it came: (m, 7) seconds after `begin_ns`, rate, force."""
        first, last = bisect.bisect_left(self._stamps, begin_ns), bisect.bisect_right(self._stamps, end_ns)
        return self._table(begin_ns, first, last)

    def between(self, begin_ns: int, end_ns: int, zero_ns: int) -> Doubles:
        """Samples (m, 7), m >= 2, from exactly `begin_ns` to `end_ns`, ends interpolated or held.

        Times are seconds after `zero_ns`. Must not be called before a first sample came.
        """
        first = max(bisect.bisect_right(self._stamps, begin_ns) - 1, 0)
        last = min(bisect.bisect_left(self._stamps, end_ns) + 1, len(self._stamps))
        table = self._table(zero_ns, first, max(last, first + 1))
        begin, end = (begin_ns - zero_ns) * 1e-9, (end_ns - zero_ns) * 1e-9
        inner = table[(table[:, 0] > begin) & (table[:, 0] < end)]
        return np.vstack([_at(table, begin), inner, _at(table, end)])

    def covers(self, begin_ns: int, end_ns: int, longest_s: float) -> bool:
        """Whether samples stand all over a stretch, none farther apart than that."""
        return self.newest_ns >= end_ns - int(longest_s * 1e9) and self.gap_s(begin_ns, end_ns) <= longest_s

    def gap_s(self, begin_ns: int, end_ns: int) -> float:
        """Longest silence (s) within a stretch."""
        first, last = bisect.bisect_left(self._stamps, begin_ns), bisect.bisect_right(self._stamps, end_ns)
        return float(np.diff([begin_ns, *self._stamps[first:last], end_ns]).max()) * 1e-9

    def taken(self, end_ns: int) -> None:
        """All before `end_ns` has been used; only the last of it is kept, to interpolate from."""
        self._taken_ns = max(self._taken_ns, end_ns - 1)
        self._forget(end_ns)

    def clear(self) -> None:
        """All is as at the beginning, but for the count of what was late."""
        self._stamps.clear()
        self._rows.clear()
        self._taken_ns = -1

    def _forget(self, before_ns: int) -> None:
        drop = bisect.bisect_right(self._stamps, before_ns) - 1
        if drop > 0:
            del self._stamps[:drop], self._rows[:drop]

    def _table(self, zero_ns: int, first: int, last: int) -> Doubles:
        table = np.empty((last - first, 7))
        table[:, 0] = [(stamp - zero_ns) * 1e-9 for stamp in self._stamps[first:last]]
        if last > first:
            table[:, 1:] = self._rows[first:last]
        return table


def _at(table: Doubles, t: float) -> Doubles:
    k = min(max(int(np.searchsorted(table[:, 0], t)), 1), len(table) - 1) if len(table) > 1 else 0
    if k == 0:
        return np.concatenate([[t], table[0, 1:]])
    a, b = table[k - 1], table[k]
    share = min(max((t - a[0]) / (b[0] - a[0]), 0.0), 1.0)
    return np.concatenate([[t], a[1:] + share * (b[1:] - a[1:])])
