"""The GoPro HERO8 as a sensor: finds it, streams its video, keeps its own recording in step with the session."""

from __future__ import annotations

import logging
import time
from threading import Event

from drivers.driver import Emit, SensorHealth, SensorState
from drivers.errors import DriverError, SensorRefused, SensorUnreachable, SensorUnsupported
from drivers.gopro import usb
from drivers.gopro.api import Camera
from drivers.gopro.card import CardRecording
from drivers.gopro.config import Config
from drivers.gopro.frames import FrameBuilder
from drivers.gopro.link import Link
from drivers.gopro.receiver import Receiver
from drivers.gopro.report import Report
from drivers.gopro.status import Trouble
from drivers.gopro.streams import Preview, Stream, Webcam
from drivers.messages import SensorEvent, Severity

logger = logging.getLogger(__name__)
WIFI_ADDRESS = "10.5.5.9"
FLOWING_NS = 2_000_000_000


class Sensor:
    """Driver of one camera. The control loop runs in the thread of `run`, the stream in one of its own."""

    def __init__(self, name: str, config: Config) -> None:
        self.name = name
        self._config = config
        self._wanted = Event()
        self._report = Report()
        self._frames = FrameBuilder(int(config.latency_ms * 1e6))
        self._receiver: Receiver | None = None
        self._emit: Emit | None = None
        self._link: Link | None = None
        self._epochs = 0

    def run(self, emit: Emit, stop: Event) -> None:
        """Until `stop`; finds the camera again whenever it went away."""
        self._emit = emit
        self._receiver = receiver = Receiver(self._frames, emit, self._new_epoch)
        try:
            while not stop.is_set():
                self._attempt(receiver, stop)
                stop.wait(self._config.retry_s)
        except Exception as error:
            logger.exception("the camera's control thread ended")
            text = f"Camera driver failed: {type(error).__name__}: {error}"
            self._report.set(SensorState.FAILED, Trouble(text, "Restart the recorder; send its log to the developers."))
        finally:
            if self._link is not None and self._link.touched:
                self._say_goodbye(self._link)
            receiver.close()

    def health(self) -> SensorHealth:
        """State, rate, losses, battery, card."""
        stream = self._frames.tally.report(self._config.expected_hz)
        last_ns = self._frames.tally.last_ns
        flowing = last_ns > 0 and time.monotonic_ns() - last_ns < FLOWING_NS
        receiver = self._receiver
        facts = {} if receiver is None else _stream_facts(self._config, receiver, self._frames)
        return self._report.health(self.name, stream, flowing, self._frames.clock_state(), facts)

    def session_started(self) -> None:
        """The control loop starts the camera's recording at its next turn."""
        self._wanted.set()

    def session_stopped(self) -> None:
        """The control loop stops the camera's recording at its next turn."""
        self._wanted.clear()

    def _attempt(self, receiver: Receiver, stop: Event) -> None:
        """One connection, from search to loss."""
        try:
            receiver.open(self._config.host, self._config.stream_port)
        except SensorRefused as error:
            self._fail(SensorState.FAILED, error, "Close the other program on that port; the camera knows no other.")
            return
        try:
            receiver.start()
            self._link = link = self._connect(self._camera(self._config.timeout_s), receiver)
            link.prepare(stop)
            if not stop.is_set():
                link.stay(stop)
        except SensorUnreachable as error:
            self._lost(error)
        except DriverError as error:
            self._refused(error)

    def _camera(self, timeout_s: float) -> Camera:
        return Camera(self._address(), self._config.http_port, self._config.host, timeout_s)

    def _address(self) -> str:
        config = self._config
        if config.address:
            return config.address
        if config.mode == "wifi":
            return WIFI_ADDRESS
        return usb.address_of_serial(config.serial) if config.serial else usb.find()

    def _connect(self, camera: Camera, receiver: Receiver) -> Link:
        config = self._config
        stream: Stream = Preview(camera) if config.mode == "wifi" else Webcam(camera, config)
        records = config.mode == "wifi" and config.record_on_camera
        card = CardRecording(camera, self._wanted, self._tell) if records else None
        link = Link(
            camera,
            stream,
            card=card,
            receiver=receiver,
            tally=self._frames.tally,
            config=config,
            report=self._report,
            tell=self._tell,
        )
        if self._link is not None:
            link.inherit(self._link)
        return link

    def _say_goodbye(self, link: Link) -> None:
        for failure in link.leave():
            logger.warning("the camera may be left running: %s", failure)
            self._tell(Severity.WARNING, f"camera may be left running: {failure}")

    def _lost(self, error: DriverError) -> None:
        advice = "Is it on, and its Wi-Fi up? Open the preview in the phone app once to wake the Wi-Fi."
        if self._config.mode == "usb":
            advice = "Is it on, and plugged in with USB set to GoPro Connect?"
        self._fail(SensorState.SEARCHING, error, advice)

    def _refused(self, error: DriverError) -> None:
        advice = "Connect a HERO8 Black." if isinstance(error, SensorUnsupported) else "Switch the camera off and on."
        self._fail(SensorState.FAILED, error, advice)

    def _fail(self, state: SensorState, error: DriverError, advice: str) -> None:
        """One event a change, not one a retry."""
        before = self._report.phase
        if before is not state and before is not SensorState.SEARCHING:
            self._tell(Severity.WARNING, f"camera lost: {error}")
        logger.info("camera: %s", error)
        self._report.set(state, Trouble(str(error), advice))

    def _tell(self, severity: Severity, text: str) -> None:
        now_ns = time.monotonic_ns()
        if self._emit is not None:
            self._emit(SensorEvent(now_ns, now_ns, self.name, severity, text))

    def _new_epoch(self, receive_ns: int) -> None:
        self._epochs += 1
        if self._epochs > 1:
            self._tell(Severity.WARNING, "camera stream clock began anew (stream or camera restarted)")


def _stream_facts(config: Config, receiver: Receiver, frames: FrameBuilder) -> dict[str, str]:
    counts, losses = receiver.order.counts, receiver.demuxer.losses
    return {
        "mode": config.mode,
        "datagrams": str(counts.received),
        "lost packets": str(losses.packets),
        "damaged frames": str(losses.units),
        "frames before a keyframe": str(frames.tally.skipped),
        "duplicates": str(counts.duplicates),
        "reordered": str(counts.reordered),
        "rubbish": str(counts.rubbish + receiver.foreign),
    }
