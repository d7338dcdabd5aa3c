"""The recorder as a process of its own, under load, on a folder of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from benchmarks.recording.load import Load
from edge import toml_table
from edge.control.client import ControlClient
from edge.control.messages import Status
from edge.errors import ControlError

UP_S = 40.0
TROUBLE = ("kernel drops", "malformed packets", "odd packets", "packets later than their scan")


@dataclass(frozen=True, slots=True)
class Bench:
    """A running recorder. `client` is connected."""

    pid: int
    client: ControlClient


@contextmanager
def recorder(folder: Path, load: Load) -> Iterator[Bench]:
    """Started as systemd would, with default settings but for the addresses; stopped politely."""
    folder.mkdir(parents=True, exist_ok=True)
    socket = folder / "control.sock"
    config = folder / "mapforest.toml"
    table = {
        "recording": {"folder": str(folder / "recordings"), "min_free_mib": 256, "min_free_percent": 0.5},
        "control": {"socket": str(socket)},
        "sensors": load.sensor_tables(),
    }
    config.write_text(toml_table.render(table), encoding="utf-8")
    command = [sys.executable, "-m", "benchmarks.recording.named_recorder", "--config", str(config)]
    with (folder / "recorder.log").open("a") as log:
        process = subprocess.Popen(command, stderr=log, stdin=subprocess.DEVNULL, env=_environment())
    try:
        with _connected(socket, process) as client:
            _wait_for_sensors(client)
            yield Bench(process.pid, client)
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(60)


def lost(status: Status) -> dict[str, int]:
    """Messages lost by stream, by the drivers' own counters."""
    return {f"{sensor.name}.{stream.name}": stream.lost for sensor in status.sensors for stream in sensor.streams}


def trouble(status: Status) -> dict[str, int]:
    """What the LiDAR's driver says about packets it could not take in order."""
    details = {
        key: value for sensor in status.sensors if sensor.name == "livox" for key, value in sensor.details.items()
    }
    return {key: int(details.get(key, "0")) for key in TROUBLE}


def wait_for_verdict(client: ControlClient) -> tuple[str, tuple[str, ...]]:
    """The validator's word on the session just stopped."""
    deadline_s = time.monotonic() + 120.0
    while time.monotonic() < deadline_s:
        verdict = client.status().verdict
        if verdict is not None and not verdict.running:
            return verdict.verdict, verdict.reasons
        time.sleep(0.2)
    return "none", ()


def _environment() -> dict[str, str]:
    root = str(Path(__file__).parents[2])
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))}


@contextmanager
def _connected(socket: Path, process: subprocess.Popen[bytes]) -> Iterator[ControlClient]:
    deadline_s = time.monotonic() + UP_S
    while True:
        try:
            client = ControlClient(socket, timeout_s=60.0)
            client.connect()
        except ControlError:
            if process.poll() is not None or time.monotonic() > deadline_s:
                raise
            time.sleep(0.1)
        else:
            break
    with client:
        yield client


def _wait_for_sensors(client: ControlClient) -> None:
    deadline_s = time.monotonic() + UP_S
    while waiting := [sensor for sensor in client.status().sensors if sensor.state != "ok"]:
        if time.monotonic() > deadline_s:
            raise RuntimeError("; ".join(f"{one.name} {one.state}: {one.problem}" for one in waiting))
        time.sleep(0.25)
