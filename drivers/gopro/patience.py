"""Waiting for the camera: every wait has an end, and a no counts only when the camera was not busy."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Event

from drivers.errors import SensorRefused
from drivers.gopro import status
from drivers.gopro.api import Camera
from drivers.gopro.status import CameraStatus, Condition

WAIT_S = 5.0
POLL_S = 0.5
"""The camera asks for no more than two requests a second (status 60)."""


def wait_for(
    camera: Camera, stop: Event, wanted: str, holds: Condition, timeout_s: float | None = None
) -> CameraStatus | None:
    """Poll until a condition on the status holds; None when stopped. SensorRefused when it never does."""
    timeout_s = WAIT_S if timeout_s is None else timeout_s
    deadline = time.monotonic() + timeout_s
    while True:
        now = status.read(camera.status())
        if holds(now):
            return now
        if time.monotonic() > deadline:
            raise SensorRefused(f"the camera is not {wanted} after {timeout_s:.0f} s. Switch it off and on")
        if stop.wait(POLL_S):
            return None


def insist(camera: Camera, stop: Event, command: Callable[[], None]) -> None:
    """Command; when it is refused by a busy camera, once more after that. SensorRefused when the no is meant."""
    try:
        command()
    except SensorRefused:
        if not status.read(camera.status()).busy:
            raise
        wait_for(camera, stop, "done with its work", lambda now: not now.busy)
        command()
