"""One thread a driver, started with the service and kept going, whether a session is recorded or not."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from drivers.driver import Driver, Emit, SensorHealth, SensorState
from drivers.messages import Message, SensorEvent, Severity

log = logging.getLogger(__name__)

BACKOFF_S = (1.0, 2.0, 5.0, 10.0, 30.0)
"""Pauses before a driver is started again; the last one repeats."""
STABLE_S = 60.0
"""A driver that ran this long starts with the shortest pause again."""
_JOIN_S = 5.0
_REPORT = "it is started again by itself; if that repeats, report it with the recorder's log"


@dataclass(frozen=True)
class Plan:
    """How to build a sensor's driver. `build` may be slow and may fail: it runs in the driver's own thread."""

    name: str
    build: Callable[[], Driver]


class DriverRunner:
    """Runs one driver, again and again if it has to be."""

    def __init__(self, plan: Plan, sink: Emit, backoff_s: tuple[float, ...] = BACKOFF_S) -> None:
        self.name = plan.name
        self.received = 0
        """Messages so far: stands still when the driver does."""
        self._plan = plan
        self._sink = sink
        self._backoff_s = backoff_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"driver-{plan.name}", daemon=True)
        self._lock = threading.Lock()
        self._driver: Driver | None = None
        self._in_session = False
        self._crash = ""
        self._deaths = 0

    def start(self) -> None:
        """Start the driver's thread."""
        self._thread.start()

    def stop(self) -> None:
        """Ask the driver to end. Returns at once; `join` waits."""
        self._stop.set()

    def join(self, timeout_s: float) -> None:
        """Wait for the driver's polite goodbye, but not for ever."""
        if self._thread.ident is None:
            return  # never started: the service failed before
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            log.warning("driver %s does not end; leaving it behind", self.name)

    def health(self) -> SensorHealth:
        """The driver's own word, or what became of it."""
        with self._lock:
            driver, crash = self._driver, self._crash
        if driver is None:
            state = SensorState.FAILED if crash else SensorState.SEARCHING
            return SensorHealth(self.name, state, problem=crash, advice=_REPORT if crash else "")
        try:
            return driver.health()
        except Exception as error:  # a bug in a driver must not stop the health of the others
            log.exception("driver %s: health failed", self.name)
            return SensorHealth(
                self.name, SensorState.FAILED, problem=f"its driver is broken: {error!r}", advice=_REPORT
            )

    def set_in_session(self, recording: bool) -> None:
        """Tell the driver that a recording began or ended."""
        with self._lock:
            self._in_session, driver = recording, self._driver
        if driver is not None:
            self._tell(driver, recording)

    def _run(self) -> None:
        """Thread root."""
        while not self._stop.is_set():
            began_s = time.monotonic()
            try:
                self._run_once()
                reason = "its driver ended by itself"
            except Exception as error:  # the thread's root: whatever it is, the sensor must come back
                log.exception("driver %s died", self.name)
                reason = f"its driver died: {error!r}"
            with self._lock:
                self._driver, self._crash = None, reason
            if not self._stop.is_set():
                self._pause(reason, time.monotonic() - began_s)

    def _run_once(self) -> None:
        driver = self._plan.build()
        with self._lock:
            self._driver, in_session = driver, self._in_session
        if in_session:
            self._tell(driver, recording=True)
        driver.run(self._emit, self._stop)

    def _pause(self, reason: str, ran_s: float) -> None:
        self._deaths = 1 if ran_s >= STABLE_S else self._deaths + 1
        pause_s = self._backoff_s[min(self._deaths, len(self._backoff_s)) - 1]
        log.error("driver %s: %s; starting it again in %g s", self.name, reason, pause_s)
        now_ns = time.monotonic_ns()
        self._sink(SensorEvent(now_ns, now_ns, self.name, Severity.ERROR, reason))
        self._stop.wait(pause_s)

    def _emit(self, message: Message) -> None:
        self.received += 1
        self._sink(message)

    def _tell(self, driver: Driver, recording: bool) -> None:
        try:
            driver.session_started() if recording else driver.session_stopped()
        except Exception:  # a bug in a driver must not keep a recording from starting or ending
            log.exception("driver %s: told of the session, failed", self.name)


class Supervisor:
    """All drivers."""

    def __init__(self, plans: Iterable[Plan], sink: Emit, backoff_s: tuple[float, ...] = BACKOFF_S) -> None:
        self.runners = tuple(DriverRunner(plan, sink, backoff_s) for plan in plans)

    def start(self) -> None:
        """Start every driver."""
        for runner in self.runners:
            runner.start()

    def stop(self, timeout_s: float = _JOIN_S) -> None:
        """End every driver, all at the same time, within `timeout_s`."""
        for runner in self.runners:
            runner.stop()
        deadline = time.monotonic() + timeout_s
        for runner in self.runners:
            runner.join(max(0.0, deadline - time.monotonic()))

    def health(self) -> tuple[SensorHealth, ...]:
        """Of every sensor, in the order of the configuration."""
        return tuple(runner.health() for runner in self.runners)

    def session_started(self) -> None:
        """Tell every driver."""
        for runner in self.runners:
            runner.set_in_session(True)

    def session_stopped(self) -> None:
        """Tell every driver."""
        for runner in self.runners:
            runner.set_in_session(False)
