"""A tiny video, loopback addresses of its own, and a driver running in a thread, for the tests of the camera."""

import itertools
import random
import threading
import time
from dataclasses import dataclass, field

from drivers.gopro.config import Config
from drivers.gopro.driver import Sensor
from drivers.messages import SensorEvent, VideoFrame
from drivers.sim.faults import parse
from drivers.sim.gopro_device import Quirks
from drivers.sim.gopro_emulator import Emulator
from tests.drivers.sources import tiny_units
from tests.drivers.switched import SwitchedPlan
from tests.waiting import PATIENCE_S

_numbers = itertools.count(random.SystemRandom().randrange(1, 1 << 22))
STREAM_PORT = random.SystemRandom().randrange(20_000, 32_000)
"""Not the camera's 8554: a driver under another test may listen there on all addresses."""


def loopback_address() -> str:
    """127.x.y.z that no other test uses."""
    number = next(_numbers) % (1 << 24 - 2) + 0x10000
    return f"127.{number >> 16 & 0xFF}.{number >> 8 & 0xFF}.{number % 254 + 1}"


class TinySource:
    """VideoSource of `tiny_units`, over and over; its frames can be told apart by their bytes."""

    def access_unit(self, index: int) -> tuple[bytes, bool]:
        units = tiny_units()
        return units[index % len(units)], index % 10 == 0


def emulator(*faults: str, quirks: Quirks | None = None, source=None, truth=None, address=None, port=0) -> Emulator:
    plan = SwitchedPlan("gopro", [parse(fault) for fault in faults])
    epoch_ns = time.monotonic_ns()
    return Emulator(
        source or TinySource(), plan, epoch_ns, address or loopback_address(), port, STREAM_PORT, truth, quirks
    )


@dataclass
class Running:
    """A driver at work. `frames` and `events` grow while it runs."""

    config: Config
    frames: list[VideoFrame] = field(default_factory=list)
    events: list[SensorEvent] = field(default_factory=list)

    def __enter__(self) -> "Running":
        if hasattr(self, "sensor"):
            return self
        self.sensor = Sensor("gopro", self.config)
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self.sensor.run, args=(self._emit, self.stop))
        self.thread.start()
        return self

    def __exit__(self, *_) -> None:
        self.end()

    def end(self) -> None:
        self.stop.set()
        self.thread.join(PATIENCE_S)
        assert not self.thread.is_alive()

    def _emit(self, message) -> None:
        (self.frames if isinstance(message, VideoFrame) else self.events).append(message)

    def told(self, text: str) -> bool:
        return any(text in event.text for event in list(self.events))


def config(address: str, http_port: int, **changes) -> Config:
    """Of a driver on its own loopback address, quick to look again, and patient with a busy machine."""
    patient = {"timeout_s": PATIENCE_S, "stall_s": PATIENCE_S}
    values = {"host": loopback_address(), "retry_s": 0.2, "poll_s": 0.5, **patient, **changes}
    return Config(address=address, http_port=http_port, stream_port=STREAM_PORT, **values)
