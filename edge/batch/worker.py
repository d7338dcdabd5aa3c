"""What runs inside a worker: a look around, and a step with word of how it goes."""

from __future__ import annotations

import logging
import os
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import msgspec
from distributed import Worker, get_worker

from edge import __version__
from edge.batch.plan import Step
from edge.batch.sessions import find_sessions
from edge.batch.work import Finished, work
from edge.config import Config
from edge.errors import ClusterError, UsageError
from edge.process.watch import Watch

_EVERY_S = 0.5


class Look(msgspec.Struct, frozen=True):
    """What a worker says of itself. sessions: how many it sees; memory: its resource in bytes, 0 for none."""

    version: str
    sessions: int
    memory: float
    threads: int
    refine: bool


def can_refine() -> bool:
    """Whether what the extra `refine` brings is there."""
    return all(find_spec(name) is not None for name in ("gtsam", "small_gicp"))


def version() -> str:
    """Run on the scheduler, which has to load what it hands on."""
    return __version__


def look(directory: Path, dask_worker: Worker) -> Look:
    """Run on every worker before anything else."""
    try:
        sessions = len(find_sessions(directory))
    except UsageError:
        sessions = 0
    resources, threads = dask_worker.state.total_resources, dask_worker.state.nthreads
    return Look(__version__, sessions, resources.get("memory", 0.0), threads, can_refine())


def run(step: Step, config: Config, expected: str, topic: str) -> Finished:
    """The task. A worker that came later, of another version, is caught here."""
    if expected != __version__:
        raise ClusterError(f"a worker runs mapforest {__version__}, not {expected}: install the same one there")
    for name in ("edge", "pipeline", "pyogrio"):  # what has to be said stands in the products' notes
        logging.getLogger(name).setLevel(logging.ERROR)
    return work(step, config, _Told(get_worker(), topic, step))


class _Told(Watch):
    """Tells who listens to the topic: first that the step has begun here."""

    def __init__(self, worker: Worker, topic: str, step: Step) -> None:
        self._worker, self._topic, self._step = worker, topic, step
        self._part, self._next_s = "", 0.0
        self._say(0.0, begun=True)

    def stage(self, name: str, *, done: bool) -> None:
        """A part of it."""
        self._part = name
        self._say(float(done))

    def advance(self, share: float) -> None:
        """Twice a second."""
        if time.monotonic() >= self._next_s:
            self._say(share)

    def _say(self, share: float, *, begun: bool = False) -> None:
        self._next_s = time.monotonic() + _EVERY_S
        word = Word(str(self._step.session), self._step.stage, self._part, share, begun, os.getpid())
        told: dict[str, Any] = msgspec.to_builtins(word)
        self._worker.log_event(self._topic, told)


class Word(msgspec.Struct, frozen=True):
    """How a step goes. share: 0..1 of the part. begun: the first word of a try. pid: of the worker, on its machine."""

    session: str
    stage: str
    part: str
    share: float
    begun: bool
    pid: int
