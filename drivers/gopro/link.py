"""One connection to a camera, from the first answer to the goodbye: section 6 of the reference sheet."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import datetime, timezone
from functools import partial
from threading import Event

from drivers.driver import SensorState
from drivers.errors import DriverError, ProtocolError, SensorRefused, SensorUnreachable
from drivers.gopro import status
from drivers.gopro.api import VIDEO_GROUP, Camera
from drivers.gopro.card import CardRecording, Tell
from drivers.gopro.config import Config
from drivers.gopro.frames import FrameTally
from drivers.gopro.patience import insist, wait_for
from drivers.gopro.receiver import Receiver
from drivers.gopro.report import Report
from drivers.gopro.status import CameraStatus, Trouble
from drivers.gopro.streams import Stream
from drivers.gopro.watchdog import StreamSigns, Watchdog
from drivers.messages import Severity

READY_S = 15.0
TICK_S = 0.1
GOODBYE_S = 2.0
"""Bound of each HTTP exchange while the program ends."""
SILENT_COMMANDS = Trouble("The camera streams, but does not answer commands.", "If it stays so, switch it off and on.")


class Link:
    """Called by the control thread alone."""

    def __init__(
        self,
        camera: Camera,
        stream: Stream,
        *,
        card: CardRecording | None,
        receiver: Receiver,
        tally: FrameTally,
        config: Config,
        report: Report,
        tell: Tell,
    ) -> None:
        self._camera = camera
        self._stream = stream
        self._card = card
        self._receiver = receiver
        self._tally = tally
        self._config = config
        self._report = report
        self._tell = tell
        self._watchdog = Watchdog(config.stall_s, config.stream_port)
        self._next_poll_s = 0.0
        self._mute = False
        self.touched = False
        """The camera was told something that has to be undone at the end."""

    def inherit(self, before: Link) -> None:
        """What an earlier connection left running is to be ended by this one."""
        self.touched = before.touched
        if self._card is not None and before._card is not None:
            self._card.active = before._card.active

    def prepare(self, stop: Event) -> None:
        """Identify, wait until ready, set up."""
        info = self._camera.identify()
        with self._report.lock:
            self._report.info, self._report.address = info, self._camera.address
        self._report.starting()
        self._tell(Severity.INFO, f"camera found: {info.model}, firmware {info.firmware}, serial {info.serial}")
        now = self._wait_until_ready(stop)
        if now is None:
            return
        if self._card is not None:
            self._card.found(now)
        if not now.recording:
            self._set_up(stop)

    def stay(self, stop: Event) -> None:
        """Stream, and keep everything as it should be until `stop` or until the link is lost."""
        self.touched = True
        self._start_stream(stop, again=False)
        self._report.set(SensorState.OK)
        while not stop.is_set():
            if self._receiver.failure:
                raise ProtocolError(f"the camera's stream broke the driver: {self._receiver.failure}")
            self._poll()
            if self._card is not None and self._card.tend(stop) and not stop.is_set():
                self._start_stream(stop, again=True)
            if self._watchdog.starved(time.monotonic(), self._signs()):
                self._tell(Severity.WARNING, "camera stream is silent; starting it again")
                self._start_stream(stop, again=True)
            stop.wait(TICK_S)

    def leave(self) -> list[DriverError]:
        """Shutter off, stream off. Tries all unless the camera is gone; gives back what did not work."""
        failures: list[DriverError] = []
        self.touched = False
        self._camera.timeout_s = min(self._camera.timeout_s, GOODBYE_S)
        steps = [self._stream.stop] if self._card is None else [self._card.finish, self._stream.stop]
        for step in steps:
            try:
                step()
            except DriverError as error:
                failures.append(error)
                if isinstance(error, SensorUnreachable):
                    break
        self._receiver.watch(None)
        return failures

    def _wait_until_ready(self, stop: Event) -> CameraStatus | None:
        """A flag that never clears (seen on a real HERO8) does not keep the stream from being tried."""
        try:
            return wait_for(self._camera, stop, "ready", lambda now: now.ready and not now.busy, READY_S)
        except SensorRefused as error:
            self._tell(Severity.WARNING, f"{error}; going on all the same")
            return status.read(self._camera.status())

    def _set_up(self, stop: Event) -> None:
        steps = [(f"setting {key} to {value}", key, value) for key, value in self._config.settings.items()]
        if self._config.set_clock:
            self._try(stop, "the clock", lambda: self._camera.set_clock(datetime.now(timezone.utc)))
        self._try(stop, "video mode", partial(self._camera.set_group, VIDEO_GROUP))
        for what, key, value in steps:
            self._try(stop, what, partial(self._camera.set_setting, key, value))
        now = status.read(self._camera.status())
        for what, key, value in steps:
            if now.settings.get(key, value) != value:
                self._tell(Severity.WARNING, f"camera did not take {what}: it is {now.settings[key]}")
        if now.group not in {None, VIDEO_GROUP}:
            self._tell(Severity.WARNING, f"camera is not in video mode but in group {now.group}")

    def _try(self, stop: Event, what: str, command: Callable[[], None]) -> None:
        try:
            insist(self._camera, stop, command)
        except (SensorRefused, ProtocolError) as error:
            self._tell(Severity.WARNING, f"camera refuses {what}: {error}")

    def _start_stream(self, stop: Event, again: bool) -> None:
        self._receiver.watch((self._camera.address, self._config.stream_port))
        self._receiver.restarted()
        self._watchdog.started(time.monotonic())
        try:
            if again:
                self._stream.restart(stop)
            else:
                self._stream.start(stop)
        finally:
            self._watchdog.started(time.monotonic())

    def _signs(self) -> StreamSigns:
        return StreamSigns(self._receiver.last_datagram_s, self._tally.last_ns / 1e9)

    def _poll(self) -> None:
        now_s = time.monotonic()
        if now_s < self._next_poll_s:
            return
        self._next_poll_s = now_s + self._config.poll_interval_s
        now = self._ask()
        if now is not None and self._card is not None:
            self._card.seen(now)
        with self._report.lock:
            self._report.status = now or self._report.status
            self._report.silence = self._silence(now or self._report.status)
            self._report.warnings = self._warnings(now or self._report.status)

    def _ask(self) -> CameraStatus | None:
        """A lost answer is a lost link only when the stream is silent too."""
        try:
            answer = status.read(self._camera.status())
        except SensorUnreachable:
            if time.monotonic() - self._receiver.last_datagram_s > self._config.stall_s:
                raise
            self._mute = True
            return None
        except (SensorRefused, ProtocolError):  # not known whether webcam mode answers this (section 10)
            return None
        self._mute = False
        return answer

    def _silence(self, now: CameraStatus | None) -> Trouble | None:
        return self._watchdog.trouble(time.monotonic(), self._signs(), now.streaming if now else None)

    def _warnings(self, now: CameraStatus | None) -> tuple[Trouble, ...]:
        found: list[Trouble | None] = []
        if self._card is not None:
            found.append(self._card.trouble)
        if self._mute:
            found.append(SILENT_COMMANDS)
        if now is not None:
            limits = self._config.low_battery_percent, self._config.low_card_s
            found += status.troubles(now, self._card is not None, *limits)
        return tuple(trouble for trouble in found if trouble is not None)
