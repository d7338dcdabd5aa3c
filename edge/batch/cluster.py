"""Workers: some of our own on this machine, or those of somebody's scheduler."""

from __future__ import annotations

import logging
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import dask
import psutil
from distributed import Client, LocalCluster
from distributed.system import MEMORY_LIMIT

from edge import __version__
from edge.batch.worker import Look, look, version
from edge.errors import ClusterError

WAIT_S = 15.0
"""For a scheduler to answer, and for its first worker."""
_SAME = "install the same one there"
_NO_MAPFOREST = f"cannot load mapforest ({{}}): install mapforest {__version__} with the extra `cluster` there"
START = "dask worker {} --nworkers 4 --nthreads 1 --resources 'memory=8e9'"
_SETTINGS = {
    "distributed.scheduler.allowed-failures": 2,
    "distributed.scheduler.worker-ttl": None,  # native code may hold the interpreter for minutes
    "distributed.worker.memory.target": False,  # results are small: there is nothing to spill
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,  # a paused worker that frees nothing waits for ever
    "distributed.worker.profile.enabled": False,  # it looks at our threads a hundred times a second
    "distributed.nanny.pre-spawn-environ": {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},  # no trimmed heap
    "distributed.comm.timeouts.connect": "30s",
}


def memory_bytes() -> int:
    """What workers here may take together: nine tenths of what is free, and of what the container allows."""
    return int(0.9 * min(psutil.virtual_memory().available, MEMORY_LIMIT))


def hush() -> None:
    """What Dask logs of workers that come and go is said by us, in our words."""
    for name in ("distributed", *logging.root.manager.loggerDict):
        if name.startswith("distributed"):  # some have levels of their own
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


@contextmanager
def local(workers: int, memory: int) -> Iterator[Client]:
    """Processes of our own, on loopback, one thread each; one that dies is replaced.

    memory: bytes of all together. A worker that outgrows its share is ended.
    """
    share = memory // workers
    with dask.config.set(_SETTINGS), _deaf_children():
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
            memory_limit=share,
            resources={"memory": share},
        )
    with dask.config.set(_SETTINGS), cluster, Client(cluster, set_as_default=False) as client:
        yield client


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Ctrl-C reaches every process of the terminal: only this one is to act on it. The mask is handed on to threads and
    processes that begin meanwhile, and by these to all that they begin."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def existing(address: str) -> Iterator[Client]:
    """ClusterError where nobody answers."""
    try:
        client = Client(address, timeout=WAIT_S, set_as_default=False)
    except (OSError, ValueError, ImportError) as error:
        raise ClusterError(
            f"{address}: no Dask scheduler answers there ({error}); start one with `dask scheduler`, and give the "
            "address that it prints"
        ) from error
    with client:
        yield client


def fit_workers(client: Client, directory: Path, sessions: int) -> list[Look]:
    """All of them as they say they are. ClusterError where one, or the scheduler, is not fit, with what to do."""
    where = client.scheduler.address
    _check_scheduler(client, where)
    try:
        client.wait_for_workers(1, timeout=WAIT_S)
    except TimeoutError:
        raise ClusterError(f"{where}: the scheduler has no workers; start some: {START.format(where)}") from None
    found = client.run(look, directory, on_error="return")
    for address, told in found.items():
        if why := _unfit(told, directory, sessions, where):
            raise ClusterError(f"worker {address} {why}")
    return list(found.values())


def _check_scheduler(client: Client, where: str) -> None:
    """It unpacks the tasks that it hands on."""
    try:
        there = client.run_on_scheduler(version)
    except Exception as error:  # whatever it raised over there, as Dask hands it on
        raise ClusterError(f"the scheduler at {where} {_NO_MAPFOREST.format(error)}") from error
    if there != __version__:
        raise ClusterError(f"the scheduler at {where} runs mapforest {there}, and this is {__version__}: {_SAME}")


def _unfit(told: Look | BaseException, directory: Path, sessions: int, scheduler: str) -> str:
    """Empty for one that is fit."""
    if "No module named" in str(told):  # Dask hands on its text, not the error
        return _NO_MAPFOREST.format(told)
    if isinstance(told, BaseException):
        return f"cannot say what it sees: {type(told).__name__}: {told}"
    if told.version != __version__:
        return f"runs mapforest {told.version}, and this is {__version__}: {_SAME}"
    if told.sessions != sessions:
        seen = f"sees {told.sessions} of the {sessions} sessions in" if told.sessions else "does not see"
        return f"{seen} {directory}: mount it there at the same place"
    if told.threads != 1 or not told.memory:
        lacks = "declares no memory" if not told.memory else f"has {told.threads} threads, and needs one"
        return f"{lacks}; start it so: {START.format(scheduler)}"
    return ""
