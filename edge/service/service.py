"""The recorder service: everything put together, and the loop that watches it."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Sequence
from functools import partial

from drivers import registry
from drivers.driver import Driver
from edge.bus.server import BusServer
from edge.config import Config, sensor_driver, sensor_settings, to_toml
from edge.control.messages import Reply, Request, Status
from edge.paths import control_socket, recordings_folder
from edge.recording.calibration import load_calibration
from edge.recording.messages import Recordable
from edge.recording.session import repair_leftovers
from edge.ros.topics import channels
from edge.service.control_server import ControlServer
from edge.service.health import Health
from edge.service.intake import Intake
from edge.service.judge import Judge
from edge.service.live import LiveView
from edge.service.notify import Notifier
from edge.service.recorder import SOFTWARE, Recorder
from edge.service.supervisor import Plan, Supervisor

log = logging.getLogger(__name__)

TICK_S = 0.25
LOOK_NS = 1_000_000_000


class Service:
    """The recorder. `run` returns when told to stop, with the session finished."""

    def __init__(
        self,
        config: Config,
        *,
        plans: Sequence[Plan] | None = None,
        judge: Judge | None = None,
        notifier: Notifier | None = None,
    ) -> None:
        """plans, judge, notifier: others than the configured ones, for tests.

        ConfigError for whatever would keep a session from starting later, in the field: a bad driver table, topics
        that clash, a calibration that cannot be used.
        """
        channels(config.topics)
        load_calibration(config.calibration)
        self._config = config
        self._notifier = notifier or Notifier()
        self._live = LiveView(config) if config.live.enabled else None
        self._bus = BusServer(config, control_socket(config).parent, self._take) if config.bus.enabled else None
        self._intake = Intake(tuple(part.offer for part in (self._live, self._bus) if part is not None))
        self._supervisor = Supervisor(driver_plans(config) if plans is None else plans, self._intake.take)
        self._judge = judge or Judge(to_toml(config))
        self._recorder = Recorder(config, self._intake, self._supervisor, self._judge)
        self._health = Health(config, self._supervisor, self._intake, self._recorder, self._judge)
        if self._bus is not None:
            self._health.pipeline = self._bus
        self._server = ControlServer(control_socket(config), self, config.control.group, SOFTWARE)
        self._next_look_ns = 0
        self._told = ""
        self._ending: threading.Thread | None = None

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop` is set. ControlError when another recorder is running."""
        self._health.look(time.monotonic_ns())
        self._server.start()
        try:
            self._start()
            while not stop.wait(TICK_S):
                self.tick(time.monotonic_ns())
        finally:
            self._shut_down()

    def tick(self, now_ns: int) -> None:
        """Four times a second: tell the clients; once a second: look at everything."""
        if now_ns >= self._next_look_ns:
            self._next_look_ns = now_ns + LOOK_NS
            self._health.look(now_ns)
            self._tell_systemd()
        self._end_if_ended()
        self._server.publish(self._health.status(now_ns))

    def handle(self, request: Request, receive_ns: int) -> Reply:
        """For the control server."""
        return self._recorder.handle(request, receive_ns)

    def status(self) -> Status:
        """For the control server."""
        return self._health.status(time.monotonic_ns())

    def _take(self, message: Recordable) -> None:
        self._intake.take(message)

    def _start(self) -> None:
        if self._bus is not None:
            self._bus.start()
            if self._bus.problem:
                self._health.notices.append(self._bus.problem)
        threading.Thread(target=self._repair, name="repair", daemon=True).start()
        if self._live is not None:
            self._live.start()
            if self._live.problem:
                self._health.notices.append(self._live.problem)
        self._supervisor.start()
        self._notifier.ready()
        log.info("%s is up, control socket %s", SOFTWARE, control_socket(self._config))

    def _shut_down(self) -> None:
        self._notifier.stopping()
        self._judge.close()  # first: the session that ends now is validated when somebody asks for it
        self._finish_session()
        self._supervisor.stop()
        self._server.publish(self._health.status(time.monotonic_ns()))
        self._server.stop()
        for part in (self._live, self._bus):
            if part is not None:
                part.stop()
        self._notifier.close()

    def _finish_session(self) -> None:
        """A slow card may need longer than the watchdog waits: it is fed on, while the writer gets on."""
        finishing = threading.Thread(
            target=self._recorder.stop, args=("the recorder was stopped",), name="finishing", daemon=True
        )
        finishing.start()
        while finishing.is_alive():
            finishing.join(TICK_S)
            self.tick(time.monotonic_ns())

    def _tell_systemd(self) -> None:
        if self._health.alive:
            self._notifier.ping()
        text = self._health.summary()
        if text != self._told:
            self._told = text
            self._notifier.status(text)

    def _end_if_ended(self) -> None:
        """Finish a session whose writer gave up (disk reserve, disk error), beside the loop: a slow card takes long."""
        status = self._recorder.session_status
        busy = self._ending is not None and self._ending.is_alive()
        if status is not None and status.ended and not busy and self._recorder.state == "recording":
            log.error("session %s ended: %s", status.session, status.ended)
            self._ending = threading.Thread(
                target=self._recorder.stop, args=("its writer gave up",), name="ending", daemon=True
            )
            self._ending.start()

    def _repair(self) -> None:
        """Thread root."""
        try:
            for repair in repair_leftovers(recordings_folder(self._config)):
                text = f"session {repair.session} was cut off (power or kill)"
                if repair.error:
                    self._health.notices.append(f"{text}: {repair.error}")
                else:
                    text = f"{text} and repaired, {repair.messages} messages kept, {repair.lost_bytes} bytes lost"
                    self._recorder.tell(f"{text}; it is not being recorded any more, start again if you need to")
                log.warning("%s %s", text, repair.error)
        except Exception as error:  # the thread's root: an odd file must not keep the payload from recording
            log.exception("repair failed")
            self._health.notices.append(f"old recordings could not be put in order ({error}); see the log")
        finally:
            self._recorder.repaired.set()


def driver_plans(config: Config) -> list[Plan]:
    """How to build each configured sensor's driver. ConfigError for a bad table; the drivers load in their threads."""
    plans = []
    for name in config.sensors:
        settings = sensor_settings(config, name)
        plans.append(Plan(name, partial(_build, sensor_driver(config, name), name, settings)))
    return plans


def _build(driver: str, name: str, settings: object) -> Driver:
    built: Driver = registry.driver_type(driver)(name, settings)
    return built
