"""Session time: UTC anchored once at the start of a session, monotonic from there on."""

from __future__ import annotations

import time
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Anchor:
    """One instant in both clocks. A step of the system clock afterwards changes nothing in the session."""

    utc_ns: int
    monotonic_ns: int

    @classmethod
    def now(cls) -> Anchor:
        """Anchor at this instant. The tightest of a few readings, so a preemption between the clocks hardly counts."""
        readings = []
        for _ in range(5):
            before = time.monotonic_ns()
            utc = time.time_ns()
            after = time.monotonic_ns()
            readings.append((after - before, utc, (before + after) // 2))
        _, utc, monotonic = min(readings)
        return cls(utc, monotonic)

    @property
    def offset_ns(self) -> int:
        """What is added to host time to get session time."""
        return self.utc_ns - self.monotonic_ns

    def session_ns(self, host_ns: int) -> int:
        """Session time (nanoseconds since 1970) of a host stamp (`CLOCK_MONOTONIC`)."""
        return host_ns + self.utc_ns - self.monotonic_ns
