"""When to look at the next image: as often as asked, unless the processor's time or its heat is against it."""

from __future__ import annotations

WARM_BELOW_C = 10.0
"""So far below the hot temperature the pace begins to slow."""
LEAST_EASE = 0.1
THROTTLED_EASE = 0.25
_SMOOTHING = 0.3


class Pace:
    """At most `rate_hz`, and at most `core_share` of one core. Not thread-safe."""

    def __init__(self, rate_hz: float, core_share: float, hot_c: float) -> None:
        self._rate_hz = rate_hz
        self._core_share = core_share
        self._hot_c = hot_c
        self._cost_s: float | None = None
        self._ease = 1.0
        self._heat = ""
        self._next_ns = 0

    @property
    def rate_hz(self) -> float:
        """What is aimed at now."""
        affordable_hz = self._core_share / self._cost_s if self._cost_s else self._rate_hz
        return min(self._rate_hz, affordable_hz) * self._ease

    @property
    def note(self) -> str:
        """Why it is slower than asked; empty when it is not."""
        if self._heat:
            return f"{self._heat}: {self.rate_hz:.1f} images/s"
        if self.rate_hz < 0.95 * self._rate_hz:
            return f"an image takes {self._cost_s or 0.0:.2f} s of a core: {self.rate_hz:.1f} images/s"
        return ""

    def due(self, now_ns: int) -> bool:
        """Whether the next image is to be looked at."""
        return now_ns >= self._next_ns

    def looked(self, began_ns: int, cost_s: float) -> None:
        """At an image, from then on, for so many seconds of processor time."""
        self._cost_s = cost_s if self._cost_s is None else self._cost_s + _SMOOTHING * (cost_s - self._cost_s)
        self._next_ns = began_ns + int(1e9 / self.rate_hz)

    def feel(self, temperature_c: float | None, *, throttled: bool) -> None:
        """How hot the computer is: slower from ten degrees below hot on."""
        over_c = (temperature_c or 0.0) - (self._hot_c - WARM_BELOW_C)
        self._ease = min(1.0, max(LEAST_EASE, 1.0 - over_c / WARM_BELOW_C))
        self._heat = f"{temperature_c:.0f} °C" if self._ease < 1.0 else ""
        if throttled and self._ease > THROTTLED_EASE:
            self._ease, self._heat = THROTTLED_EASE, "the computer is throttled"
