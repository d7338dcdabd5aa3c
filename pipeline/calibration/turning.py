"""How fast something turned: mean angular rates over intervals, from a gyroscope or from pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipeline.calibration.errors import CalibrationError

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Turning:
    """Row i: the mean rate (rad/s), in the sensor's own axes, from begin_ns[i] to end_ns[i]. In order of time.

    begin_ns, end_ns: (n,). rate: (n, 3). Intervals may leave holes, and do not overlap.
    """

    begin_ns: Stamps
    end_ns: Stamps
    rate: Array

    def __len__(self) -> int:
        return len(self.begin_ns)

    @property
    def middle_ns(self) -> Stamps:
        """(n,) of each interval."""
        return self.begin_ns + (self.end_ns - self.begin_ns) // 2

    @property
    def period_s(self) -> float:
        """The usual length of an interval."""
        return float(np.median(self.end_ns - self.begin_ns)) * 1e-9 if len(self) else 0.0

    @property
    def rms_rad_s(self) -> float:
        """How much it turned, apart from a constant rate."""
        return float(np.sqrt(np.mean(np.sum((self.rate - self.rate.mean(axis=0)) ** 2, axis=1)))) if len(self) else 0.0

    def shifted(self, by_ns: int) -> Turning:
        """The same in a clock that is ahead by so much."""
        return replace(self, begin_ns=self.begin_ns + by_ns, end_ns=self.end_ns + by_ns)

    def within(self, first_ns: int, last_ns: int) -> Turning:
        """The intervals between two instants."""
        inside = (self.begin_ns >= first_ns) & (self.end_ns <= last_ns)
        return Turning(self.begin_ns[inside], self.end_ns[inside], self.rate[inside])


def of_gyro(stamps_ns: Stamps, rate: Array) -> Turning:
    """Of a gyroscope's samples (n,), (n, 3): each stands for the time around it. CalibrationError for less than two."""
    order = np.argsort(stamps_ns, kind="stable")
    stamps_ns, rate = stamps_ns[order], rate[order]
    fresh = np.r_[True, np.diff(stamps_ns) > 0]
    stamps_ns, rate = stamps_ns[fresh], rate[fresh]
    if len(stamps_ns) < 2:
        raise CalibrationError("no inertial data: a gyroscope of at least two samples is needed")
    half = np.minimum(np.diff(stamps_ns), 4 * int(np.median(np.diff(stamps_ns)))) // 2
    return Turning(stamps_ns - np.r_[half[0], half], stamps_ns + np.r_[half, half[-1]], np.asarray(rate, np.float64))


class Angle:
    """The integral of a turning, to be asked between any two instants.

    Adds angles as vectors: over the 33 ms of a frame the error is of the order of rate^2 * 33 ms, and of no concern.
    """

    def __init__(self, turning: Turning) -> None:
        self._origin_ns = int(turning.begin_ns[0])
        edges = np.column_stack([turning.begin_ns, turning.end_ns]).ravel() - self._origin_ns
        step = turning.rate * ((turning.end_ns - turning.begin_ns) * 1e-9)[:, None]
        total = np.cumsum(step, axis=0)
        # Flat in holes: whoever asks there gets no turning, see `covers`.
        self._at_s = edges * 1e-9
        self._angle = np.stack([total - step, total], axis=1).reshape(-1, 3)
        self._span_s = (float(self._at_s[0]), float(self._at_s[-1]))
        gap = (turning.begin_ns[1:] - turning.end_ns[:-1]) * 1e-9
        wide = gap > 4.0 * turning.period_s
        self._holes = (self._at_s[1:-1:2][wide], self._at_s[2::2][wide])

    def mean_rate(self, begin_ns: Stamps, end_ns: Stamps, later_s: float) -> Array:
        """(n, 3) between the instants, both taken so much later."""
        begin, end = self._relative(begin_ns, later_s), self._relative(end_ns, later_s)
        return np.asarray((self._integral(end) - self._integral(begin)) / (end - begin)[:, None])

    def covers(self, begin_ns: Stamps, end_ns: Stamps, later_s: float) -> npt.NDArray[np.bool_]:
        """(n,) whether there is data all the way between the instants."""
        begin, end = self._relative(begin_ns, later_s), self._relative(end_ns, later_s)
        inside = (begin >= self._span_s[0]) & (end <= self._span_s[1])
        opened = np.searchsorted(self._holes[0], end, side="left")
        closed = np.searchsorted(self._holes[1], begin, side="right")
        return np.asarray(inside & (opened == closed))

    def _relative(self, stamps_ns: Stamps, later_s: float) -> Array:
        return np.asarray((stamps_ns - self._origin_ns) * 1e-9 + later_s, np.float64)

    def _integral(self, at_s: Array) -> Array:
        columns: list[Array] = [np.interp(at_s, self._at_s, self._angle[:, axis]) for axis in range(3)]
        return np.stack(columns, axis=1)
