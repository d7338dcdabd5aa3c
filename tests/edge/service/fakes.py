"""A sensor on command, and the pieces of a recorder around it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from drivers.driver import Emit, SensorHealth, SensorState, StreamHealth
from drivers.messages import ImuSample, Message
from edge.config import Config, Control, Recording
from edge.control.client import ControlClient
from edge.service.service import Service
from tests.waiting import PATIENCE_S


def imu(host_ns: int) -> ImuSample:
    return ImuSample(host_ns, host_ns, (0.0, 0.0, 0.1), (0.0, 0.0, 9.81))


class FakeDriver:
    """Emits what it is given; dies when told to."""

    def __init__(self, name: str = "fake") -> None:
        self.name = name
        self.emit: Emit | None = None
        self.running = threading.Event()
        self.crash = threading.Event()
        self.told: list[str] = []
        self.state = SensorState.OK
        self.expected_hz = 0.0
        self.health_error: Exception | None = None

    def run(self, emit: Callable[[Message], None], stop: threading.Event) -> None:
        self.emit = emit
        self.running.set()
        while not stop.wait(0.005):
            if self.crash.is_set():
                raise RuntimeError("a bug")

    def health(self) -> SensorHealth:
        if self.health_error:
            raise self.health_error
        return SensorHealth(self.name, self.state, (StreamHealth("imu", 200.0, self.expected_hz, 1, 0, 0.01),))

    def session_started(self) -> None:
        self.told.append("started")

    def session_stopped(self) -> None:
        self.told.append("stopped")


def config(folder: Path) -> Config:
    """Records below `folder`, with no sensor of its own."""
    return Config(
        recording=Recording(folder=str(folder / "recordings"), min_free_mib=0, min_free_percent=0.0),
        control=Control(socket=str(folder / "control.sock")),
        sensors={},
    )


@contextmanager
def running(service: Service, socket_path: Path) -> Iterator[ControlClient]:
    """The service in a thread, and a client of it."""
    stop = threading.Event()
    thread = threading.Thread(target=service.run, args=(stop,))
    service_started = threading.Event()
    original = service._start

    def start() -> None:
        original()
        service_started.set()

    service._start = start  # type: ignore[method-assign]
    thread.start()
    assert service_started.wait(PATIENCE_S)
    try:
        with ControlClient(socket_path) as client:
            yield client
    finally:
        stop.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
