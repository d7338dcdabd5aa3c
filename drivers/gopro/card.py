"""The recording on the camera's own card, kept in step with the session."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Event

from drivers.errors import ProtocolError, SensorRefused
from drivers.gopro import shutter
from drivers.gopro.api import Camera
from drivers.gopro.status import CameraStatus, Trouble
from drivers.messages import Severity

RETRY_S = 15.0
Tell = Callable[[Severity, str], None]
"""Puts an event into the recording."""


class CardRecording:
    """Presses the shutter when the session says so. One instance a connection; `wanted` outlives it."""

    def __init__(self, camera: Camera, wanted: Event, tell: Tell) -> None:
        self._camera = camera
        self._wanted = wanted
        self._tell = tell
        self._next_try_s = 0.0
        self._failed = ""
        self.active = False

    @property
    def trouble(self) -> Trouble | None:
        """What keeps the camera from recording."""
        if not self._failed or not self._wanted.is_set():
            return None
        return Trouble(self._failed, "Check the camera's card and battery, or switch it off and on.")

    def found(self, status: CameraStatus) -> None:
        """What the camera was doing when it was reached."""
        self.active = status.recording
        if self.active and not self._wanted.is_set():
            self._tell(Severity.WARNING, "camera was recording without a session; stopping it")
        elif self.active:
            self._tell(Severity.INFO, "camera was recording already; going on with it")

    def seen(self, status: CameraStatus) -> None:
        """A later status: did it stop by itself?"""
        if not self.active or status.recording:
            return
        self.active = False
        if self._wanted.is_set():
            self._failed = "The camera stopped recording by itself."
            self._tell(Severity.WARNING, f"camera stopped recording by itself (card {status.card}, hot {status.hot})")

    def tend(self, stop: Event) -> bool:
        """Start or stop when needed. True when the shutter was pressed: the preview has to be asked for again."""
        wanted = self._wanted.is_set()
        if wanted == self.active or time.monotonic() < self._next_try_s:
            return False
        try:
            act = shutter.press(self._camera, wanted, stop)
        except (SensorRefused, ProtocolError) as error:
            self._refused(wanted, str(error))
            return True
        if act is not None:
            self.active, self._failed, self._next_try_s = wanted, "", 0.0
            self._tell(Severity.INFO, act.words)
        return True

    def finish(self) -> None:
        """The driver ends: leave no recording behind, whatever the session says."""
        if not self.active:
            return
        act = shutter.press(self._camera, False, Event())
        self.active = False
        if act is not None:
            self._tell(Severity.INFO, act.words)

    def _refused(self, wanted: bool, why: str) -> None:
        self._next_try_s = time.monotonic() + RETRY_S
        text = f"camera does not {'start' if wanted else 'stop'} recording: {why}"
        if text != self._failed:
            self._tell(Severity.ERROR, text)
        self._failed = text
