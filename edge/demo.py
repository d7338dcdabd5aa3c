"""The whole mission on the emulated payload: up, record the walk, judge the recording, compare with the truth."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeAlias

from drivers.sim.payload import Payload, PayloadConfig
from drivers.sim.scenarios import WorldConfig
from drivers.sim.world import build
from edge import toml_table
from edge.control.client import ControlClient
from edge.control.messages import Request, Status, Verdict
from edge.detection import DEMO, DEMO_MODEL
from edge.errors import ControlError, EdgeError

UP_S = 60.0
COMPILED_S = 300.0
"""The first start of the pipeline on a machine compiles it: 40 s on a core of its own."""
FINISH_S, LEAVE_S = 60.0, 10.0
"""A recorder finishes its session; a pipeline has nothing to lose, and does not listen while it compiles."""
VERDICT_S = 60.0
TAIL_S = 4.0
"""Recorded at rest after the walk."""
POLL_S = 0.5


@dataclass(frozen=True, slots=True)
class Stage:
    """Folders of one run of the demonstration."""

    folder: Path

    @property
    def config(self) -> Path:
        """The recorder's configuration."""
        return self.folder / "mapforest.toml"

    @property
    def socket(self) -> Path:
        """The recorder's control socket."""
        return self.folder / "control.sock"

    @property
    def truth(self) -> Path:
        """What is true of the simulated walk."""
        return self.folder / "truth"

    @property
    def plots(self) -> Path:
        """The errors of the trajectories, as a page."""
        return self.folder / "evaluation.html"

    def log(self, service: str) -> Path:
        """What the recorder or the pipeline says."""
        return self.folder / f"{service}.log"


Process: TypeAlias = "subprocess.Popen[bytes]"
Watch = Callable[[Status, float], None]
"""Shown each new state with the share of the walk that is done."""


def payload_config(stage: Stage, world: WorldConfig) -> PayloadConfig:
    """The emulated payload of the demonstration."""
    return PayloadConfig(world=world, truth=stage.truth)


def prepare(stage: Stage, payload: PayloadConfig) -> None:
    """Write the recorder's configuration."""
    stage.folder.mkdir(parents=True, exist_ok=True)
    # Small enough a reserve to run on a laptop's disk; everything else is as on the payload.
    table: dict[str, dict[str, Any]] = {
        "recording": {"folder": str(stage.folder / "recordings"), "min_free_mib": 256, "min_free_percent": 0.5},
        "mission": {"name": "demo", "carrier": payload.world.carrier},
        "control": {"socket": str(stage.socket)},
        "sensors": payload.driver_tables(),
    }
    if DEMO_MODEL.exists() and find_spec("onnxruntime") is not None:
        table["detection"] = {"model": DEMO}
    stage.config.write_text(toml_table.render(table), encoding="utf-8")


@contextmanager
def recorder(stage: Stage) -> Iterator[ControlClient]:
    """The recorder as a process of its own, as systemd would run it; stopped politely at the end."""
    with _service(stage, "recorder", FINISH_S) as process, _connect(stage, process) as client:
        yield client


@contextmanager
def pipeline(stage: Stage) -> Iterator[Process]:
    """The live pipeline beside it, likewise."""
    with _service(stage, "pipeline", LEAVE_S) as process:
        yield process


@contextmanager
def _service(stage: Stage, name: str, end_s: float) -> Iterator[Process]:
    command = [sys.executable, "-m", "edge.cli.main", name, "--config", str(stage.config)]
    with stage.log(name).open("w", encoding="utf-8") as log:
        process = subprocess.Popen(command, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(timeout=end_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _connect(stage: Stage, process: Process) -> ControlClient:
    deadline_s = time.monotonic() + UP_S
    while time.monotonic() < deadline_s:
        _check(stage, "recorder", process)
        try:
            client = ControlClient(stage.socket)
            client.connect()
        except ControlError:
            time.sleep(0.1)
        else:
            return client
    log = stage.log("recorder")
    raise EdgeError(f"the recorder did not open its control socket within {UP_S:.0f} s; see {log}")


def wait_for_pipeline(stage: Stage, process: Process, client: ControlClient) -> None:
    """Until the live pipeline says where it is, or that it cannot say yet. EdgeError when it does not."""
    deadline_s = time.monotonic() + COMPILED_S
    while (status := client.status()).location is None:
        _check(stage, "pipeline", process)
        if time.monotonic() > deadline_s:
            told = "; ".join([f"see {stage.log('pipeline')}", *status.problems])
            raise EdgeError(f"the live pipeline was not up within {COMPILED_S:.0f} s; {told}")
        time.sleep(0.2)


def _check(stage: Stage, name: str, process: Process) -> None:
    if process.poll() is not None:
        words = stage.log(name).read_text(encoding="utf-8", errors="replace").splitlines()[-5:]
        told = os.linesep.join([f"the {name} ended at once; its words are in {stage.log(name)}:", *words])
        raise EdgeError(told)


def wait_for_sensors(client: ControlClient, watch: Watch) -> None:
    """Until every sensor delivers. EdgeError names those that do not."""
    deadline_s = time.monotonic() + UP_S
    while True:
        status = client.status()
        watch(status, 0.0)
        late = [s for s in status.sensors if s.state not in {"ok", "degraded"}]
        if not late:
            return
        if time.monotonic() > deadline_s:
            told = "; ".join(f"{s.name} {s.state}: {s.problem}" for s in late)
            raise EdgeError(f"sensors not ready after {UP_S:.0f} s: {told}")
        time.sleep(POLL_S)


def record_walk(client: ControlClient, payload: Payload, watch: Watch) -> Path:
    """Start, wait for the walk to end, stop. Returns the session's folder."""
    walk_ns = build(payload.config.world).trajectory.duration_ns
    end_ns = payload.epoch_ns + walk_ns + int(TAIL_S * 1e9)
    reply = client.request(Request("start", mission="demo"))
    while (now_ns := time.monotonic_ns()) < end_ns:
        payload.check()
        watch(client.status(), (now_ns - payload.epoch_ns) / (end_ns - payload.epoch_ns))
        time.sleep(POLL_S)
    client.request(Request("mark", text="end of the walk"))
    client.request(Request("stop"))
    return Path(reply.folder)


def wait_for_verdict(client: ControlClient, watch: Watch) -> Verdict:
    """The validator's word on the session just stopped."""
    deadline_s = time.monotonic() + VERDICT_S
    while time.monotonic() < deadline_s:
        status = client.status()
        watch(status, 1.0)
        if status.verdict is not None and not status.verdict.running:
            return status.verdict
        time.sleep(0.2)
    raise EdgeError(f"no verdict within {VERDICT_S:.0f} s after the stop")


def clean_truth(stage: Stage) -> None:
    """Clock truth is appended to by the emulators; an old run's must not mix in."""
    for path in stage.truth.glob("clock_*.jsonl"):
        path.unlink()


def summary(folder: Path) -> dict[str, object]:
    """`session.json` of a session."""
    loaded: dict[str, object] = json.loads((folder / "session.json").read_text(encoding="utf-8"))
    return loaded
