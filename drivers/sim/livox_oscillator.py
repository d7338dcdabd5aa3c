"""The oscillator of the emulated LiDAR: its ticks, and the stamps it writes."""

from __future__ import annotations


class Oscillator:
    """Counts nanoseconds since power-on, at a rate of its own. Stamps are ticks plus the steps made so far."""

    def __init__(self, power_on_ns: int, drift_ppm: float) -> None:
        self._base_ppm = drift_ppm
        self._rate = 1.0 + drift_ppm * 1e-6
        self._host_ns = power_on_ns
        self._ticks_ns = 0
        self._step_ns = 0

    def restart(self, power_on_ns: int) -> None:
        """Power-on: ticks count from zero again, and steps are forgotten."""
        self._host_ns, self._ticks_ns, self._step_ns = power_on_ns, 0, 0

    def drift(self, extra_ppm: float, now_ns: int) -> None:
        """Run this much faster than usual from now on."""
        rate = 1.0 + (self._base_ppm + extra_ppm) * 1e-6
        if rate != self._rate:
            self._ticks_ns, self._host_ns, self._rate = self.ticks_ns(now_ns), now_ns, rate

    def step(self, step_ns: int) -> None:
        """Jump."""
        self._step_ns += step_ns

    def ticks_ns(self, host_ns: int) -> int:
        """Nanoseconds since power-on by this oscillator."""
        return self._ticks_ns + round((host_ns - self._host_ns) * self._rate)

    def host_ns(self, ticks_ns: int) -> int:
        """When it counts so many."""
        return self._host_ns + round((ticks_ns - self._ticks_ns) / self._rate)

    def stamp_ns(self, ticks_ns: int) -> int:
        """What the device writes into its packets; never negative."""
        return max(0, ticks_ns + self._step_ns)
