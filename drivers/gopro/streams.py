"""The two ways a HERO8 streams: preview over Wi-Fi, webcam over USB. Each can be started, started again and stopped."""

from __future__ import annotations

import time
from threading import Event
from typing import Protocol

from drivers.errors import DriverError, SensorRefused, SensorUnreachable
from drivers.gopro.api import Camera, WebcamState
from drivers.gopro.config import Config

WEBCAM_WAITS_S = (3.0, 5.0, 5.0)
"""START often does nothing the first time (section 5 of the sheet)."""
POLL_S = 0.5


class Stream(Protocol):
    """One way of streaming."""

    def start(self, stop: Event) -> None:
        """Until the camera says that it streams. SensorRefused when it will not."""

    def restart(self, stop: Event) -> None:
        """The stream went silent: ask again."""

    def stop(self) -> None:
        """Leave the camera as it was found."""


class Preview:
    """848x480 or 640x480 over Wi-Fi, while the camera may record."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera

    def start(self, stop: Event) -> None:
        """One command, answered at once."""
        self._camera.preview(start=True)

    def restart(self, stop: Event) -> None:
        """The same command starts and restarts."""
        self._camera.preview(start=True)

    def stop(self) -> None:
        """Ends the stream; a recording on the card is not touched."""
        self._camera.preview(start=False)


class Webcam:
    """Up to 1080p30 over USB. The camera records nothing and ignores its settings meanwhile."""

    def __init__(self, camera: Camera, config: Config) -> None:
        self._camera = camera
        self._config = config

    def start(self, stop: Event) -> None:
        """STOP first: a client that died leaves the camera streaming into nowhere, and then START does nothing."""
        for wait_s in WEBCAM_WAITS_S:
            self._camera.webcam_stop()
            self._camera.webcam_start(self._config.webcam_resolution, self._config.stream_port)
            self._camera.webcam_settings(self._config.webcam_fov)
            state = self._wait_for_streaming(stop, wait_s)
            if state.streaming or stop.is_set():
                return
        raise SensorRefused(
            f"webcam mode does not start ({state.words}). Set USB to GoPro Connect, check for firmware 02.50 or later, "
            "then switch the camera off, pull the cable and plug it in again"
        )

    def restart(self, stop: Event) -> None:
        """The whole sequence."""
        self.start(stop)

    def _wait_for_streaming(self, stop: Event, timeout_s: float) -> WebcamState:
        deadline = time.monotonic() + timeout_s
        while True:
            state = self._camera.webcam_status()
            if state.streaming or time.monotonic() > deadline or stop.wait(POLL_S):
                return state

    def stop(self) -> None:
        """STOP and EXIT, the second also when the first is refused: left in webcam mode a camera is stuck."""
        failure: DriverError | None = None
        for call in (self._camera.webcam_stop, self._camera.webcam_exit):
            try:
                call()
            except DriverError as error:
                failure = error
                if isinstance(error, SensorUnreachable):
                    break
        if failure is not None:
            raise failure
