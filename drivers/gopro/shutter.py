"""The shutter in video mode: pressed, and verified by status 10 (encoding active)."""

from __future__ import annotations

import time
from dataclasses import dataclass
from threading import Event

from drivers.gopro.api import Camera
from drivers.gopro.patience import insist, wait_for


@dataclass(frozen=True, slots=True)
class ShutterAct:
    """A shutter command that took effect. Host times, ns."""

    on: bool
    sent_ns: int
    answered_ns: int
    confirmed_ns: int

    @property
    def words(self) -> str:
        """For the record."""
        answered_ms = (self.answered_ns - self.sent_ns) / 1e6
        confirmed_ms = (self.confirmed_ns - self.sent_ns) / 1e6
        return (
            f"camera recording {'started' if self.on else 'stopped'}: shutter sent at {self.sent_ns} ns (host "
            f"monotonic), answered after {answered_ms:.1f} ms, confirmed after {confirmed_ms:.0f} ms"
        )


def press(camera: Camera, on: bool, stop: Event) -> ShutterAct | None:
    """Start or stop the recording; None when stopped while waiting. SensorRefused when it does not happen."""
    sent_ns = answered_ns = 0

    def command() -> None:
        nonlocal sent_ns, answered_ns
        sent_ns = time.monotonic_ns()
        camera.shutter(on)
        answered_ns = time.monotonic_ns()

    insist(camera, stop, command)
    state = "recording" if on else "done recording"
    if wait_for(camera, stop, state, lambda now: now.recording == on and (on or not now.busy)) is None:
        return None
    return ShutterAct(on, sent_ns, answered_ns, time.monotonic_ns())
