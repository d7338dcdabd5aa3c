"""A sensor's clock mapped to host time.

Each arrival pairs the sensor's stamp with the host's: receive = offset + sensor * (1 + skew) + delay, delay >= latency.
Delays only ever add, so the lower envelope of (receive - sensor) follows the clock. The least difference of each
window, less what the least of n exponential delays is expected to be, is a measurement of `drivers.clock_filter`.

The map that stamps are taken from (`ClockMap`) is piecewise linear and continuous in sensor time, and a piece is fixed
before the first stamp falls into it. So two streams of one clock (points and IMU of the LiDAR) keep their exact
relative time.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.clock_filter import OffsetFilter
from drivers.clock_map import ClockMap

REBOOT_BELOW_NS = 60_000_000_000
"""A clock that went back to less than this has started anew."""
SMALL_STEP_NS = 20_000_000.0
SMALL_STEP_WINDOWS = 3
"""The envelope has to stay this far off for so many windows to be a step and not a busy host."""
BACKLOG_NS = 300_000_000
LONGEST_BACKLOG_NS = 30_000_000_000
"""Late arrivals count as a step when they stay late for longer than a backlog of that lateness takes to drain."""


@dataclass(frozen=True, slots=True)
class ClockState:
    """What is known of a sensor's clock: host = sensor + offset at `updated_ns`, skew in parts per million."""

    offset_ns: int
    skew_ppm: float
    sigma_ns: float
    """One-sigma of the stamps given now, constant transport latency excluded."""
    jitter_ns: float
    """Mean delay above the envelope: how irregular the transport is."""
    steps: int
    """Reboots and jumps of the sensor's clock seen so far."""
    synchronised: str = ""
    """What disciplines the sensor's clock by its own word (PTP, GPS), empty when nothing."""
    updated_ns: int = 0


@dataclass(frozen=True, slots=True)
class ClockStep:
    """The sensor's clock left its line by `jump_ns` (host minus predicted host)."""

    jump_ns: int
    reboot: bool
    """The sensor's own time went back to near zero."""


class _Window:
    """Arrivals of one stretch of sensor time."""

    def __init__(self, sensor_ns: int) -> None:
        self.start_ns = sensor_ns
        self.count = 0
        self.least_ns = 0
        self.least_at_ns = sensor_ns
        self.total_ns = 0

    def add(self, sensor_ns: int, difference_ns: int) -> None:
        if self.count == 0 or difference_ns < self.least_ns:
            self.least_ns, self.least_at_ns = difference_ns, sensor_ns
        self.count += 1
        self.total_ns += difference_ns

    @property
    def jitter_ns(self) -> float:
        return self.total_ns / self.count - self.least_ns


class SensorClock:
    """Maps one sensor's stamps to host time. One instance a sensor clock; not thread-safe."""

    def __init__(self, latency_ns: int = 0, step_ns: int = 1_000_000_000, window_ns: int = 1_000_000_000) -> None:
        """latency_ns: constant part of the transport delay, known by measurement. step_ns: what counts as a step."""
        self._latency_ns = latency_ns
        self._step_ns = step_ns
        self._window_ns = window_ns
        self._steps = 0
        self._jitter_ns = 0.0
        self._last_sensor_ns = 0
        self._late_until_ns: int | None = None
        self._off_windows = 0
        self._filter: OffsetFilter | None = None
        self._map: ClockMap | None = None
        self._window = _Window(0)

    def observe(self, sensor_ns: int, receive_ns: int) -> ClockStep | None:
        """Take one arrival in. Call it for each packet, in order of arrival, before mapping stamps of that packet.

        Returns the step when the sensor's clock jumped; the map then starts anew.
        """
        difference_ns = receive_ns - sensor_ns - self._latency_ns
        if self._filter is None:
            self._restart(sensor_ns, difference_ns)
            return None
        step = self._step_of(sensor_ns, difference_ns) or self._close_window(sensor_ns)
        if step is not None:
            self._restart(sensor_ns, difference_ns)
            self._steps += 1
            return step
        self._last_sensor_ns = max(self._last_sensor_ns, sensor_ns)
        if self._late_until_ns is None:
            self._window.add(sensor_ns, difference_ns)
        return None

    def to_host_ns(self, sensor_ns: int) -> int:
        """Host time of a sensor stamp. Call after the first `observe`; ValueError before it."""
        if self._filter is None or self._map is None:
            raise ValueError("a stamp was asked for before the first arrival: call observe() first")
        return self._map.to_host_ns(sensor_ns, self._filter)

    def state(self) -> ClockState | None:
        """None before the first arrival."""
        if self._filter is None or self._map is None:
            return None
        map_error_ns = self._map.error_ns(self._filter)
        return ClockState(
            offset_ns=self._filter.offset_ns(self._last_sensor_ns),
            skew_ppm=self._filter.skew * 1e6,
            sigma_ns=(self._filter.sigma_ns(self._last_sensor_ns) ** 2 + map_error_ns**2) ** 0.5,
            jitter_ns=self._jitter_ns,
            steps=self._steps,
            updated_ns=self._last_sensor_ns,
        )

    def _restart(self, sensor_ns: int, difference_ns: int) -> None:
        self._filter = OffsetFilter(sensor_ns, difference_ns)
        self._map = ClockMap(sensor_ns, difference_ns)
        self._window = _Window(sensor_ns)
        self._window.add(sensor_ns, difference_ns)
        self._last_sensor_ns = sensor_ns
        self._late_until_ns = None
        self._off_windows = 0

    def _step_of(self, sensor_ns: int, difference_ns: int) -> ClockStep | None:
        """A jump that a single arrival shows; lateness alone may be a backlog, and has to last."""
        assert self._filter is not None
        jump_ns = difference_ns - self._filter.offset_ns(sensor_ns)
        went_back = sensor_ns < self._last_sensor_ns - self._step_ns
        step = ClockStep(jump_ns, reboot=went_back and sensor_ns < min(REBOOT_BELOW_NS, self._last_sensor_ns // 2))
        if went_back or jump_ns < -self._step_ns:
            return step
        if jump_ns <= self._step_ns:
            self._late_until_ns = None
            return None
        if self._late_until_ns is None:  # a backlog as long as the lateness itself may have to be drained first
            self._late_until_ns = sensor_ns + BACKLOG_NS + (jump_ns if jump_ns < LONGEST_BACKLOG_NS else 0)
        return step if sensor_ns > self._late_until_ns else None

    def _close_window(self, sensor_ns: int) -> ClockStep | None:
        """Feed the filter when the window is over. A lasting offset of the envelope is a step too."""
        window = self._window
        if sensor_ns - window.start_ns < self._window_ns or window.count == 0:
            return None
        assert self._filter is not None
        self._window = _Window(sensor_ns)
        self._jitter_ns += (window.jitter_ns - self._jitter_ns) * (0.2 if self._jitter_ns else 1.0)
        expected_least_ns = self._jitter_ns / window.count
        innovation_ns = window.least_ns - expected_least_ns - self._filter.offset_ns(window.least_at_ns)
        doubt_ns = 5.0 * self._filter.sigma_ns(window.least_at_ns)
        if abs(innovation_ns) < max(SMALL_STEP_NS, 10.0 * self._jitter_ns, doubt_ns):
            self._filter.update(window.least_at_ns, window.least_ns - expected_least_ns, expected_least_ns)
            self._off_windows = 0
            return None
        self._off_windows += 1
        return ClockStep(int(innovation_ns), reboot=False) if self._off_windows >= SMALL_STEP_WINDOWS else None
