"""The one contract between a sensor and the appliance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from threading import Event
from typing import Protocol

from drivers.clock import ClockState
from drivers.messages import Message


class SensorState(Enum):
    """What the operator needs to know in one word."""

    SEARCHING = "searching"
    """Not reached yet, or lost: the driver keeps trying."""
    STARTING = "starting"
    """Reached, and not delivering yet (motor spin-up, camera booting, receiver without a first sentence)."""
    OK = "ok"
    DEGRADED = "degraded"
    """Delivers, with something the operator should know: losses, no fix, warm, battery low."""
    FAILED = "failed"
    """Reached, and refuses or is broken: a person must act."""


@dataclass(frozen=True, slots=True)
class StreamHealth:
    """One kind of message of a sensor since the last call of `Driver.health`."""

    name: str
    rate_hz: float
    expected_hz: float
    received: int
    """Messages since the driver started."""
    lost: int
    """Losses since the driver started, in the unit the sensor counts (packets, sentences, frames)."""
    largest_gap_s: float
    """Longest silence between two receptions since the last call."""
    units: int = 0
    """Received since the driver started, in the unit losses are counted in; 0: the same as `received`."""


@dataclass(frozen=True, slots=True)
class SensorHealth:
    """State of one sensor. `problem` says what is wrong, `advice` what to do about it; both empty when all is well."""

    name: str
    state: SensorState
    streams: tuple[StreamHealth, ...] = ()
    clock: ClockState | None = None
    problem: str = ""
    advice: str = ""
    temperature_c: float | None = None
    battery_percent: float | None = None
    details: dict[str, str] = field(default_factory=dict)
    """Sensor-specific facts for the file and the screen: serial number, firmware, address, fix quality."""


Emit = Callable[[Message], None]
"""Takes a message off a driver's hands at once. Never blocks and never raises."""


class Driver(Protocol):
    """A sensor that turns its wire protocol into stamped messages. Construction is cheap and does no I/O."""

    name: str

    def run(self, emit: Emit, stop: Event) -> None:
        """Receive until `stop` is set. Reconnects by itself; never raises for what the sensor does."""

    def health(self) -> SensorHealth:
        """Rates, gaps, losses and state since the last call. Called from another thread, about once a second."""

    def session_started(self) -> None:
        """A recording began. Returns at once; called from another thread (a camera starts its own recording)."""

    def session_stopped(self) -> None:
        """The recording ended. Returns at once; called from another thread."""
