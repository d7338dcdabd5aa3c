"""Are the sensors there: asked of the running recorder, else by listening to each of them for some seconds."""

from __future__ import annotations

import threading
import time

from drivers.driver import Driver, SensorHealth, SensorState
from drivers.registry import driver_type
from edge.config import Config, sensor_driver, sensor_settings
from edge.control.messages import Sensor, Status
from edge.preflight.check import Check, Outcome

LISTEN_S = 20.0
"""A LiDAR that has to start its motor needs up to 15 s."""
_OUTCOMES = {
    "ok": Outcome.GOOD,
    "degraded": Outcome.WARNING,
    "starting": Outcome.WARNING,
    "searching": Outcome.BAD,
    "failed": Outcome.BAD,
}


def check_running(status: Status) -> list[Check]:
    """The sensors as the recorder sees them now."""
    return [_from_status(sensor) for sensor in status.sensors]


def check_heard(healths: list[SensorHealth]) -> list[Check]:
    """The sensors as they were when listened to."""
    return [_from_health(health) for health in healths]


def listen(config: Config, listen_s: float = LISTEN_S) -> list[SensorHealth]:
    """Start each driver without recording, and wait until it delivers or `listen_s` is over."""
    drivers = [_build(config, name) for name in config.sensors]
    stop = threading.Event()
    threads = [threading.Thread(target=d.run, args=(_ignore, stop), name=f"doctor-{d.name}") for d in drivers]
    for thread in threads:
        thread.start()
    try:
        return _wait(drivers, time.monotonic() + listen_s)
    finally:
        stop.set()
        for thread in threads:
            thread.join(timeout=10.0)


def _build(config: Config, name: str) -> Driver:
    driver: Driver = driver_type(sensor_driver(config, name))(name, sensor_settings(config, name))
    return driver


def _ignore(message: object) -> None:
    """Nothing is recorded by a check."""


def _wait(drivers: list[Driver], deadline_s: float) -> list[SensorHealth]:
    pause = threading.Event()
    while True:
        pause.wait(0.5)
        healths = [driver.health() for driver in drivers]
        if all(health.state is SensorState.OK for health in healths) or time.monotonic() > deadline_s:
            return healths


def _from_health(health: SensorHealth) -> Check:
    rates = ", ".join(f"{s.name} {s.rate_hz:.0f}/s" for s in health.streams)
    return _check(health.name, health.state.value, rates, health.problem, health.advice)


def _from_status(sensor: Sensor) -> Check:
    rates = ", ".join(f"{s.name} {s.rate_hz:.0f}/s" for s in sensor.streams)
    return _check(sensor.name, sensor.state, rates, sensor.problem, sensor.advice)


def _check(name: str, state: str, rates: str, problem: str, advice: str) -> Check:
    found = ": ".join(part for part in (state, problem or rates) if part)
    return Check(f"sensor {name}", _OUTCOMES[state], found, advice)
