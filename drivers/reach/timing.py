"""The receiver's UTC mapped to host time."""

from __future__ import annotations

from drivers.clock import ClockState, ClockStep, SensorClock
from drivers.reach.epoch import Instant

STEP_NS = 500_000_000
"""A receiver that learns the leap seconds jumps by a whole second: half of it tells a jump."""


class ReceiverClock:
    """Maps epochs to host time. Each epoch is taken in once, at its first sentence where its date is known by then."""

    def __init__(self, latency_ns: int) -> None:
        self._latency_ns = latency_ns
        self._clock = SensorClock(latency_ns, step_ns=STEP_NS)
        self._assumed = False
        self._leap_second = False
        self._utc_ns: int | None = None
        self._stamp_ns = 0

    def stamp(self, instant: Instant, date_assumed: bool) -> tuple[int, ClockStep | None]:
        """Host time of the instant's measurement, and the step of the receiver's clock that it showed."""
        if instant.utc_ns == self._utc_ns and instant.leap_second == self._leap_second:
            return self._stamp_ns, None
        if (self._assumed and not date_assumed) or (self._leap_second and not instant.leap_second):
            # The date became known, or POSIX time repeated a second: no fault of the receiver, but another line.
            self._clock = SensorClock(self._latency_ns, step_ns=STEP_NS)
        self._assumed = date_assumed
        step = None
        if not instant.leap_second or self._clock.state() is None:
            step = self._clock.observe(instant.utc_ns, instant.receive_ns)
        self._utc_ns, self._leap_second = instant.utc_ns, instant.leap_second
        self._stamp_ns = self._clock.to_host_ns(instant.utc_ns)
        return self._stamp_ns, step

    def state(self) -> ClockState | None:
        """None before the first epoch."""
        return self._clock.state()
