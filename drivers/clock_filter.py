"""Two-state Kalman filter of a clock: offset and skew against host time.

Plain floats: two states need no matrix library, and the recorder must start without loading one (0.9 s here).
"""

from __future__ import annotations

OFFSET_FLOOR_NS = 20_000.0
"""Least one-sigma of an envelope measurement: scheduling of an idle host."""
FIRST_SIGMA_NS = 50e6
"""A first arrival may be late by this much: a camera's first frame, a serial line flushed in mid-epoch."""
SKEW_SIGMA = 100e-6
"""One-sigma of an unknown crystal."""
SKEW_WALK = 0.02e-6
"""Random walk of the skew per square root of a second: warming up at 1 ppm a minute stays within it."""
GATE_SIGMA = 3.0


class OffsetFilter:
    """host - sensor as a straight line in sensor time, with its covariance."""

    def __init__(self, sensor_ns: int, difference_ns: int) -> None:
        self._at_ns = sensor_ns
        self._base_ns = difference_ns
        self._offset_ns = 0.0  # on top of the base, so that a float keeps its nanoseconds
        self.skew = 0.0
        self._p_oo = FIRST_SIGMA_NS**2
        self._p_ok = 0.0
        self._p_kk = SKEW_SIGMA**2

    def offset_ns(self, sensor_ns: int) -> int:
        """Predicted host - sensor."""
        return self._base_ns + round(self._offset_ns + self.skew * (sensor_ns - self._at_ns))

    def sigma_ns(self, sensor_ns: int) -> float:
        """One-sigma of `offset_ns`."""
        dt_ns = float(sensor_ns - self._at_ns)
        return float(max(self._p_oo + 2.0 * dt_ns * self._p_ok + dt_ns * dt_ns * self._p_kk, 0.0) ** 0.5)

    def update(self, sensor_ns: int, difference_ns: float, sigma_ns: float) -> None:
        """Take a measured difference in.

        A measurement can be late without limit and never early, so one above the gate is weighed down by its excess.
        """
        self._predict(sensor_ns)
        innovation = difference_ns - self._base_ns - self._offset_ns
        variance = sigma_ns**2 + OFFSET_FLOOR_NS**2
        if innovation > GATE_SIGMA * (self._p_oo + variance) ** 0.5:
            variance += innovation**2
        total = self._p_oo + variance
        gain_o, gain_k = self._p_oo / total, self._p_ok / total
        self._offset_ns += gain_o * innovation
        self.skew += gain_k * innovation
        p_oo, p_ok = self._p_oo, self._p_ok
        self._p_oo = (1.0 - gain_o) * p_oo
        self._p_ok = (1.0 - gain_o) * p_ok
        self._p_kk -= gain_k * p_ok

    def _predict(self, sensor_ns: int) -> None:
        dt_ns = float(sensor_ns - self._at_ns)
        q_kk = SKEW_WALK**2 * abs(dt_ns) / 1e9
        self._offset_ns += self.skew * dt_ns
        self._p_oo += 2.0 * dt_ns * self._p_ok + dt_ns * dt_ns * (self._p_kk + q_kk / 3.0)
        self._p_ok += dt_ns * (self._p_kk + q_kk / 2.0)
        self._p_kk += q_kk
        self._at_ns = sensor_ns
