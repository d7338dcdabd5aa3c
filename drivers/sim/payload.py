"""The emulated payload: three sensors in their own processes, one world, one start."""

from __future__ import annotations

import ctypes
import multiprocessing
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.synchronize import Event
from pathlib import Path
from types import TracebackType
from typing import Any

from drivers.errors import SimulationError
from drivers.sim.camera import PREVIEW_LATENCY_S, Camera
from drivers.sim.faults import SENSORS, Fault, FaultPlan
from drivers.sim.gnss import ReceiverModel
from drivers.sim.gnss_errors import PRESETS
from drivers.sim.scenarios import WorldConfig
from drivers.sim.truth import write_epoch, write_truth
from drivers.sim.world import World, build

READY_S = 180.0
"""The first start on a machine compiles the ray caster and the rasteriser: half a minute on one slow core."""
LEAD_NS = 200_000_000
_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True, slots=True)
class PayloadConfig:
    """gnss: a preset of `gnss_errors`. truth: folder for what is true, None for none. Addresses are on loopback."""

    world: WorldConfig = field(default_factory=WorldConfig)
    gnss: str = "honest"
    faults: tuple[Fault, ...] = ()
    truth: Path | None = None
    sensors: tuple[str, ...] = SENSORS
    livox_address: str = "127.0.1.10"
    reach_address: tuple[str, int] = ("127.0.1.20", 9001)
    reach_pty: Path | None = None
    gopro_address: tuple[str, int] = ("127.0.1.30", 8080)

    def driver_tables(self) -> dict[str, dict[str, Any]]:
        """`sensors` of a recorder's configuration that reaches this payload."""
        tables: dict[str, dict[str, Any]] = {
            "livox": {"driver": "livox", "address": self.livox_address, "host_address": "127.0.0.1"},
            "reach": {"driver": "reach", "endpoint": "tcp:{}:{}".format(*self.reach_address)},
            "gopro": {
                "driver": "gopro",
                "address": self.gopro_address[0],
                "http_port": self.gopro_address[1],
                "host": "127.0.0.1",
                "latency_ms": 1e3 * PREVIEW_LATENCY_S,  # as a crew measures it, once for a unit
            },
        }
        return {name: tables[name] for name in self.sensors}


@dataclass(frozen=True, slots=True)
class _Shared:
    """What the payload and one of its processes share. epoch_ns is 0 until all are ready.

    The events are each process's own, and the value has no lock: a process that is killed in a wait would leave a
    shared event or lock unusable for all others.
    """

    epoch_ns: Any
    stop: Event
    ready: Event


class Payload:
    """`with Payload(config) as payload:` has all emulators running; leaving it ends them."""

    def __init__(self, config: PayloadConfig, hold: Callable[[], None] | None = None) -> None:
        """hold: called when all emulators are ready; the walk begins when it returns."""
        if config.gnss not in PRESETS:
            raise SimulationError(f"GNSS errors {config.gnss!r}: expected one of {', '.join(PRESETS)}")
        self.config = config
        self._hold = hold
        self._context: SpawnContext = multiprocessing.get_context("spawn")
        self._epoch_ns = self._context.RawValue("q", 0)
        self._shared: dict[str, _Shared] = {}
        self._processes: dict[str, SpawnProcess] = {}

    @property
    def epoch_ns(self) -> int:
        """CLOCK_MONOTONIC at which walk time is 0."""
        return int(self._epoch_ns.value)

    @property
    def processes(self) -> dict[str, SpawnProcess]:
        """The emulators by name, for whoever wants to measure or kill one."""
        return dict(self._processes)

    def __enter__(self) -> Payload:
        if self.config.truth is not None:
            write_truth(build(self.config.world), self.config.truth)
        with ExitStack() as unless_ready:
            unless_ready.callback(self.close)
            for name in self.config.sensors:
                self._spawn(name)
            for name in self.config.sensors:
                self._wait(name, READY_S)
            if self._hold is not None:
                self._hold()
            unless_ready.pop_all()
        self._epoch_ns.value = time.monotonic_ns() + LEAD_NS
        if self.config.truth is not None:
            write_epoch(self.config.truth, self.epoch_ns)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def check(self) -> None:
        """SimulationError when an emulator has ended by itself."""
        for name, process in self._processes.items():
            if process.exitcode not in {None, 0}:
                raise SimulationError(f"the emulated {name} ended with code {process.exitcode}; its error stands above")

    def restart(self, name: str) -> None:
        """Start an emulator that was killed again; the walk goes on where it is now."""
        self._spawn(name)
        self._wait(name, READY_S)

    def close(self) -> None:
        """End all emulators."""
        for name, process in self._processes.items():
            if process.is_alive():
                self._shared[name].stop.set()
        for process in self._processes.values():
            process.join(timeout=5.0)
            if process.is_alive():
                process.kill()
                process.join()

    def _spawn(self, name: str) -> None:
        shared = _Shared(self._epoch_ns, self._context.Event(), self._context.Event())
        target = {"livox": _livox, "reach": _reach, "gopro": _gopro}[name]
        arguments = (target, self.config, shared)
        process = self._context.Process(target=_emulate, args=arguments, name=f"emulated-{name}", daemon=True)
        process.start()
        self._processes[name], self._shared[name] = process, shared

    def _wait(self, name: str, timeout_s: float) -> None:
        deadline_s = time.monotonic() + timeout_s
        while not self._shared[name].ready.wait(0.2):
            if not self._processes[name].is_alive():
                raise SimulationError(f"the emulated {name} ended while starting; its error stands above")
            if time.monotonic() > deadline_s:
                raise SimulationError(f"the emulated {name} was not ready within {timeout_s:.0f} s")


def _emulate(body: Callable[..., None], config: PayloadConfig, shared: _Shared) -> None:
    """Root of an emulator's process. Ctrl-C is the parent's to handle; when the parent is killed, so is this."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)

    def start() -> int:
        """Tell that everything slow is done, and wait for the common start."""
        shared.ready.set()
        while shared.epoch_ns.value == 0 and not shared.stop.wait(0.005):
            continue
        return int(shared.epoch_ns.value)

    body(config, build(config.world), shared, start)


def _truth(config: PayloadConfig, name: str) -> Path | None:
    return None if config.truth is None else config.truth / f"clock_{name}.jsonl"


def _livox(config: PayloadConfig, world: World, shared: _Shared, start: Callable[[], int]) -> None:
    from drivers.sim import livox_emulator  # each process loads its own sensor only

    lidar, imu = world.lidar, world.imu
    lidar.cast(0, 9600)  # compiles
    plan = FaultPlan("livox", config.faults)
    address, truth = config.livox_address, _truth(config, "livox")
    livox_emulator.run(lidar, imu, plan, start(), shared.stop, address=address, truth_path=truth)


def _reach(config: PayloadConfig, world: World, shared: _Shared, start: Callable[[], int]) -> None:
    from drivers.sim import reach_emulator

    source = ReceiverModel(world.antenna, PRESETS[config.gnss], config.world.datum)
    source.epoch(0)
    plan = FaultPlan("reach", config.faults)
    pty, tcp, truth = config.reach_pty, config.reach_address, _truth(config, "reach")
    reach_emulator.run(source, plan, start(), shared.stop, pty=pty, tcp=tcp, truth=truth)


def _gopro(config: PayloadConfig, world: World, shared: _Shared, start: Callable[[], int]) -> None:
    from drivers.sim import gopro_emulator
    from drivers.sim.renderer import Renderer
    from drivers.sim.video import RenderedVideo

    camera = Camera()
    renderer = Renderer(world.scene, world.trajectory, camera, config.world.seed)
    renderer.render(0)  # compiles
    video = RenderedVideo(renderer, camera.width_px, camera.height_px)
    plan = FaultPlan("gopro", config.faults)
    (address, port), truth = config.gopro_address, _truth(config, "gopro")
    epoch_ns = start()
    gopro_emulator.run(video, plan, stop=shared.stop, epoch_ns=epoch_ns, address=address, http_port=port, truth=truth)
