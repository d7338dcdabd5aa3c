"""The three senders, each in a process of its own."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.sharedctypes import Synchronized
from multiprocessing.synchronize import Event

from benchmarks.recording.load import Load
from benchmarks.recording.priority import claim

READY_S = 30.0
NICE = -10
"""Hardware does not wait for a processor. Where this user may not ask for that, the senders run as all else does."""


@dataclass(frozen=True, slots=True)
class Senders:
    """The running senders: process ids by name, and the longest the LiDAR's was held up (s; may be set to 0)."""

    pids: dict[str, int]
    pause_s: Synchronized[float]


@contextmanager
def payload(load: Load) -> Iterator[Senders]:
    """All senders running."""
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    pause_s = context.Value("d", 0.0)
    bodies = {"lidar": _lidar, "receiver": _receiver, "camera": _camera}
    processes = {}
    for name, body in bodies.items():
        ready = context.Event()
        processes[name] = context.Process(
            target=body, args=(load, ready, stop, pause_s), name=f"canned-{name}", daemon=True
        )
        processes[name].start()
        if not ready.wait(READY_S):
            raise RuntimeError(f"the sender {name} did not start")
    try:
        yield Senders({name: process.pid or 0 for name, process in processes.items()}, pause_s)
    finally:
        stop.set()
        for process in processes.values():
            process.join(10.0)


def _lidar(load: Load, ready: Event, stop: Event, pause_s: Synchronized[float]) -> None:
    from benchmarks.recording.lidar import CannedLidar

    _prepare()
    CannedLidar(load, time.monotonic_ns(), pause_s).run(stop, None, ready.set)


def _receiver(load: Load, ready: Event, stop: Event, _: Synchronized[float]) -> None:
    from benchmarks.recording import receiver

    _prepare()
    ready.set()
    receiver.run(load, stop)


def _camera(load: Load, ready: Event, stop: Event, _: Synchronized[float]) -> None:
    from benchmarks.recording.camera import CannedCamera

    _prepare()
    camera = CannedCamera(load, time.monotonic_ns())
    camera.start()
    ready.set()
    stop.wait()
    camera.stop()


def _prepare() -> None:
    """Ctrl-C is the parent's to handle."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    claim(NICE)
