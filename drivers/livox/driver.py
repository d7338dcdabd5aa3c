"""The Mid-360 as a sensor of the payload."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from threading import Event, Thread

from drivers.clock import ClockStep
from drivers.driver import Emit, SensorHealth, SensorState
from drivers.livox.config import Config
from drivers.livox.receive import Receiver
from drivers.livox.report import Reporter
from drivers.livox.steward import Steward
from drivers.livox.stream import StreamDecoder
from drivers.messages import SensorEvent, Severity

log = logging.getLogger(__name__)
QUIET_S = 0.5
"""After this silence the unfinished scan goes out."""


class Sensor:
    """One Mid-360. `run` decodes; a thread of its own receives, another one looks after the LiDAR."""

    def __init__(self, name: str, config: Config) -> None:
        self.name = name
        self._config = config
        self._reporter: Reporter | None = None
        self._crash = ""

    def run(self, emit: Emit, stop: Event) -> None:
        """Receive until `stop` is set, through everything the LiDAR and the network do."""

        def note(severity: Severity, text: str) -> None:
            now_ns = time.monotonic_ns()
            emit(SensorEvent(now_ns, now_ns, self.name, severity, text))

        def jumped(step: ClockStep | None, receive_ns: int) -> None:
            steward.request_configuration()
            if step is not None:
                text = (
                    "the LiDAR started anew"
                    if step.reboot
                    else f"the LiDAR's clock jumped by {-step.jump_ns / 1e9:.3f} s"
                )
                emit(SensorEvent(receive_ns, receive_ns, self.name, Severity.WARNING, text))

        def synchronised(source: str, receive_ns: int) -> None:
            text = f"the LiDAR's clock follows {source}" if source else "the LiDAR's clock runs free"
            emit(SensorEvent(receive_ns, receive_ns, self.name, Severity.INFO, text))

        self._crash = ""
        receiver = Receiver()
        decoder = StreamDecoder(emit, jumped, synchronised, round(self._config.latency_ms * 1e6))
        steward = Steward(self._config, receiver, lambda: decoder.point_meter.last_ns, note)
        self._reporter = Reporter(self.name, receiver, decoder, steward)
        threads = [self._thread("receive", receiver.run, stop), self._thread("steward", steward.run, stop)]
        try:
            self._decode(receiver, decoder, stop)
        finally:
            for thread in threads:
                thread.join()
            receiver.close()

    def health(self) -> SensorHealth:
        """See `Driver.health`."""
        if self._reporter is None:
            return SensorHealth(self.name, SensorState.SEARCHING, problem="the driver has not been started")
        health = self._reporter.health()
        if self._crash:
            return SensorHealth(
                self.name, SensorState.FAILED, health.streams, problem=self._crash, advice=_CRASH_ADVICE
            )
        return health

    def session_started(self) -> None:
        """Nothing to do: the LiDAR streams all the time."""

    def session_stopped(self) -> None:
        """Nothing to do: the LiDAR streams all the time."""

    def _decode(self, receiver: Receiver, decoder: StreamDecoder, stop: Event) -> None:
        while not stop.is_set():
            if not receiver.wait(QUIET_S):
                decoder.flush()
            while (block := receiver.take()) is not None:
                decoder.decode(block)
                receiver.give_back(block)
        decoder.flush()

    def _thread(self, role: str, body: Callable[[Event], None], stop: Event) -> Thread:
        def root() -> None:
            try:
                body(stop)
            except Exception as error:
                log.exception("the %s thread of %s ended", role, self.name)
                self._crash = f"the {role} thread ended by an error of this program: {error!r}"

        thread = Thread(target=root, name=f"{self.name}-{role}", daemon=True)
        thread.start()
        return thread


_CRASH_ADVICE = "restart the recorder, and report this with the log"
