"""The camera's stream clock: 33 bits of 90 kHz from an arbitrary origin, made into nanoseconds that go on."""

from __future__ import annotations

from dataclasses import dataclass

WRAP = 1 << 33
CONTINUOUS_TICKS = 45_000
"""0.5 s between neighbours in the stream, whatever the network did to their arrival."""
TOLERANCE_NS = 1_000_000_000
RESTART_TOLERANCE_NS = 300_000_000
"""Over a restart only a clock that kept running is the same clock."""


def ticks_to_ns(ticks: int) -> int:
    """90 kHz to nanoseconds, rounded down."""
    return ticks * 100_000 // 9


@dataclass(frozen=True, slots=True)
class StreamTime:
    """Time of one access unit. new_epoch: the clock did not go on from the one before."""

    sensor_ns: int
    new_epoch: bool
    step_ticks: int
    """Since the access unit before; 0 in a new epoch."""


class PtsTimeline:
    """Unwraps PTS within an epoch, and sees where a new epoch begins."""

    def __init__(self) -> None:
        self._ticks: int | None = None
        self._receive_ns = 0
        self._restarted = False

    def restarted(self) -> None:
        """The stream was stopped and started: the clock may have a new origin."""
        self._restarted = True

    def place(self, pts: int, receive_ns: int) -> StreamTime:
        """Time of an access unit with this PTS that arrived at `receive_ns`."""
        last, restarted = self._ticks, self._restarted
        self._restarted = False
        elapsed_ns = receive_ns - self._receive_ns
        self._receive_ns = receive_ns
        if last is None:
            self._ticks = pts
            return StreamTime(ticks_to_ns(pts), True, 0)
        step = (pts - last + WRAP // 2) % WRAP - WRAP // 2
        if not _goes_on(step, elapsed_ns, restarted):
            self._ticks = pts
            return StreamTime(ticks_to_ns(pts), True, 0)
        self._ticks = last + step
        return StreamTime(ticks_to_ns(self._ticks), False, 0 if restarted else step)


def _goes_on(step: int, elapsed_ns: int, restarted: bool) -> bool:
    off_ns = abs(ticks_to_ns(step) - elapsed_ns)
    if restarted:
        return step > 0 and off_ns < RESTART_TOLERANCE_NS
    return abs(step) <= CONTINUOUS_TICKS or off_ns < TOLERANCE_NS
