"""A driver and an emulated LiDAR on loopback addresses of their own, in threads."""

import contextlib
import random
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest

from drivers.driver import SensorHealth
from drivers.livox.config import Config
from drivers.livox.driver import Sensor
from drivers.messages import ImuSample, LidarScan, Message, SensorEvent
from drivers.sim.faults import parse
from drivers.sim.livox_device import DeviceOptions
from drivers.sim.livox_emulator import BROADCAST, Emulator
from drivers.sim.sources import PointBlock
from tests.drivers.switched import SwitchedPlan
from tests.waiting import PATIENCE_S, wait_for


class Ramp:
    """A source whose points tell their walk time: x counts slots of 5 us modulo 20,000; every third is no return."""

    def cast(self, t_ns: int, count: int) -> PointBlock:
        slot = (t_ns // 5000 + np.arange(count)) % 20_000
        xyz = np.stack((slot + 1, np.full(count, 2000), np.full(count, -300)), axis=1).astype(np.int32)
        xyz[np.arange(count) % 3 == 0] = 0
        return PointBlock(xyz, np.full(count, 10, np.uint8), np.full(count, 16, np.uint8))

    def sample(self, t_ns: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return (0.25, 0.5, t_ns / 1e9), (0.0, 0.0, 1.0)


@dataclass
class Rig:
    """What came out of the driver so far, and both sides."""

    sensor: Sensor
    emulator: Emulator
    plan: SwitchedPlan
    messages: list[Message] = field(default_factory=list)

    def of(self, kind: type) -> list[Message]:
        return [message for message in self.messages if isinstance(message, kind)]

    @property
    def scans(self) -> list[LidarScan]:
        return self.of(LidarScan)

    @property
    def samples(self) -> list[ImuSample]:
        return self.of(ImuSample)

    @property
    def events(self) -> list[str]:
        return [event.text for event in self.of(SensorEvent)]

    def health(self) -> SensorHealth:
        return self.sensor.health()

    def truth_ns(self, sample: ImuSample) -> int:
        """When the sample was taken, by its yaw rate."""
        return self.emulator._epoch_ns + round(sample.angular_velocity[2] * 1e9)

    def lateness_ns(self) -> int:
        """Bound of the time from a measurement to its arrival: milliseconds, and whatever a busy machine adds."""
        underway_ns = max(sample.receive_ns - self.truth_ns(sample) for sample in self.samples)
        return underway_ns + self.emulator._point_stream.latest_ns


def addresses() -> tuple[str, str]:
    """Two loopback addresses, LiDAR and host, that no other test uses."""
    chosen = random.SystemRandom()
    net = f"127.{chosen.randrange(64, 128)}.{chosen.randrange(256)}"
    low = chosen.randrange(1, 127)
    return f"{net}.{low}", f"{net}.{low + 127}"


def serial() -> str:
    return f"T{random.SystemRandom().randrange(10**12):012d}"


@contextlib.contextmanager
def emulated(*faults: str, **device) -> Iterator[tuple[Emulator, str, str]]:
    """An emulator that runs in a thread. Start-up is 20 times faster."""
    lidar, host = addresses()
    plan = SwitchedPlan("livox", [parse(fault) for fault in faults])
    options = DeviceOptions(**{"time_scale": 0.05, "serial": serial()} | device)
    emulator = Emulator(Ramp(), Ramp(), plan, time.monotonic_ns(), address=lidar, options=options)
    stop, bound = threading.Event(), threading.Event()
    thread = threading.Thread(target=emulator.run, args=(stop, None, bound.set))
    thread.start()
    try:
        assert bound.wait(PATIENCE_S)
        yield emulator, lidar, host
    finally:
        stop.set()
        thread.join()


@contextlib.contextmanager
def driving(emulator: Emulator, config: Config) -> Iterator[Rig]:
    """The driver in a thread. The test is skipped where the emulator was a second late and had to leave packets out."""
    rig = Rig(Sensor("livox", config), emulator, emulator._plan)
    stop = threading.Event()
    thread = threading.Thread(target=rig.sensor.run, args=(rig.messages.append, stop))
    thread.start()
    try:
        yield rig
    finally:
        stop.set()
        thread.join()
    if emulator._point_stream.skipped:
        pytest.skip("this machine is too slow just now for an emulated LiDAR")


@contextlib.contextmanager
def running(*faults: str, settings: dict | None = None, **device) -> Iterator[Rig]:
    """Driver and emulator together, the address configured."""
    with emulated(*faults, **device) as (emulator, lidar, host), driving(emulator, quick(lidar, host, settings)) as rig:
        yield rig


def quick(lidar: str, host: str, settings: dict | None = None) -> Config:
    """A configuration with short timeouts."""
    defaults = {
        "address": lidar,
        "host_address": host,
        "discovery_address": BROADCAST,
        "reply_timeout_s": 0.2,
        "attempts": 2,
        "retry_s": 0.1,
        "silence_s": 1.0,
    }
    return Config(**defaults | (settings or {}))


def streaming(rig: Rig, scans: int = 3) -> None:
    """Wait for so many more scans."""
    wanted = len(rig.scans) + scans
    wait_for(lambda: len(rig.scans) >= wanted)
