"""Rate, gaps and coverage of one topic, from log times alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class Span:
    """The session: log times of its first and last message."""

    start_ns: int
    end_ns: int

    @property
    def duration_s(self) -> float:
        return (self.end_ns - self.start_ns) / 1e9


@dataclass(frozen=True, slots=True)
class Rates:
    """starts_s, gap_at_s: seconds after the session's start; ends_before_s: seconds before its end.

    rate_hz is the mean between the first and the last message, median_hz that of the typical interval.
    intervals_s: (n - 1,) the intervals in order of time.
    """

    count: int
    starts_s: float
    ends_before_s: float
    rate_hz: float
    median_hz: float
    largest_gap_s: float
    gap_at_s: float
    backwards: int
    intervals_s: npt.NDArray[np.float64]

    def missing_s(self, longer_than_s: float) -> float:
        """Silence beyond the mean interval, summed over the gaps longer than this."""
        gaps = self.intervals_s[self.intervals_s > longer_than_s]
        period_s = 1 / self.median_hz if self.median_hz > 0 else 0.0
        return float(np.sum(gaps - period_s)) if gaps.size else 0.0

    def gaps(self, longer_than_s: float) -> int:
        return int(np.count_nonzero(self.intervals_s > longer_than_s))


def rates_of(times_ns: npt.NDArray[np.int64], span: Span) -> Rates:
    """times_ns: (n,) log times in file order, n >= 1."""
    backwards = int(np.count_nonzero(np.diff(times_ns) < 0))
    ordered = np.sort(times_ns) if backwards else times_ns
    intervals_s = np.diff(ordered) / 1e9
    first_ns, last_ns = int(ordered[0]), int(ordered[-1])
    lasted_s = (last_ns - first_ns) / 1e9
    mean_s = lasted_s / intervals_s.size if intervals_s.size else 0.0
    median_s = float(np.median(intervals_s)) if intervals_s.size else 0.0
    widest = int(np.argmax(intervals_s)) if intervals_s.size else -1
    return Rates(
        count=times_ns.size,
        starts_s=(first_ns - span.start_ns) / 1e9,
        ends_before_s=(span.end_ns - last_ns) / 1e9,
        rate_hz=1 / mean_s if mean_s > 0 else 0.0,
        median_hz=1 / median_s if median_s > 0 else 0.0,
        largest_gap_s=float(intervals_s[widest]) if widest >= 0 else 0.0,
        gap_at_s=(int(ordered[widest]) - span.start_ns) / 1e9 if widest >= 0 else 0.0,
        backwards=backwards,
        intervals_s=intervals_s,
    )
