"""A sensor's clock mapped to host time.

Each arrival pairs the sensor's stamp with the host's: receive = offset + sensor * (1 + skew) + delay, delay >= latency.
Delays only ever add, so the lower envelope of (receive - sensor) follows the clock: the least difference of each
window is a measurement, and a two-state Kalman filter (offset, skew) tracks it.

The map that stamps are taken from is piecewise linear and continuous in sensor time, and a piece is fixed before the
first stamp falls into it. So two streams of one clock (points and IMU of the LiDAR) keep their exact relative time.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ClockState:
    """What is known of a sensor's clock: host = sensor + offset at `updated_ns`, skew in parts per million."""

    offset_ns: int
    skew_ppm: float
    sigma_ns: float
    """One-sigma of the offset, constant transport latency excluded."""
    jitter_ns: float
    """Typical delay above the envelope: how irregular the transport is."""
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


class SensorClock:
    """Maps one sensor's stamps to host time. One instance a sensor clock; not thread-safe."""

    def __init__(self, latency_ns: int = 0, step_ns: int = 1_000_000_000, window_ns: int = 1_000_000_000) -> None:
        """latency_ns: constant part of the transport delay, known by measurement. step_ns: what counts as a step."""
        raise NotImplementedError

    def observe(self, sensor_ns: int, receive_ns: int) -> ClockStep | None:
        """Take one arrival in. Call it for each packet, in order of arrival, before mapping stamps of that packet.

        Returns the step when the sensor's clock jumped; the map then starts anew.
        """
        raise NotImplementedError

    def to_host_ns(self, sensor_ns: int) -> int:
        """Host time of a sensor stamp. Call after the first `observe`."""
        raise NotImplementedError

    def state(self) -> ClockState | None:
        """None before the first arrival."""
        raise NotImplementedError
