"""The real chain: emulated sensors and the recorder, each a process of its own, on loopback addresses of their own."""

from __future__ import annotations

import json
import random
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import Any

from drivers.sim.payload import PayloadConfig
from edge import toml_table
from edge.control.client import ControlClient
from edge.control.messages import Reply, Request, Sensor, Status
from edge.errors import ControlError
from tests.waiting import PATIENCE_S, wait_for

ROOT = Path(__file__).parents[2]
SENSORS = ("livox", "reach", "gopro")
DELIVERS = ("ok", "degraded")
_chosen = random.SystemRandom()


def payload_config() -> PayloadConfig:
    """An emulated payload on loopback addresses that no other test uses."""
    net = f"127.{_chosen.randrange(64, 128)}.{_chosen.randrange(256)}"
    return PayloadConfig(
        livox_address=f"{net}.10", reach_address=(f"{net}.20", 9001), gopro_address=(f"{net}.30", 8080)
    )


class Chain:
    """`with Chain(folder) as chain:` has the emulators and the recorder running; leaving it ends them.

    `told`: everything the operator was told since the start, in order, without repetitions that differ in numbers only.
    """

    def __init__(
        self,
        folder: Path,
        sensors: Iterable[str] = SENSORS,
        *,
        recording: dict[str, Any] | None = None,
        drivers: dict[str, dict[str, Any]] | None = None,
        launcher: list[str] | None = None,
        faulty: bool = False,
        payload: PayloadConfig | None = None,
    ) -> None:
        """recording, drivers: changes to the defaults. launcher: what runs the recorder, may be changed before
        each start. faulty: the recorder with a disk and a clock that obey. payload: emulators run elsewhere."""
        self.folder = folder
        self.sensors = tuple(sensors)
        self.recordings = folder / "recordings"
        self.socket = folder / "control.sock"
        self.config = folder / "mapforest.toml"
        self.log = folder / "recorder.log"
        self.told: list[str] = []
        self.status: Status | None = None
        self.recorder: subprocess.Popen[bytes] | None = None
        self.emulators: dict[str, subprocess.Popen[str]] = {}
        self.payload = payload or payload_config()
        self.stream_port = 8554 if payload else _chosen.randrange(20_000, 32_000)
        self.host = self.payload.livox_address.rpartition(".")[0] + ".1"
        self.addresses = {
            "livox": self.payload.livox_address,
            "reach": self.payload.reach_address[0],
            "gopro": self.payload.gopro_address[0],
        }
        self._own_emulators = payload is None
        self._serial = f"R{_chosen.randrange(10**12):012d}"
        self._incarnations = dict.fromkeys(self.sensors, 0)
        self.launcher = launcher or []
        self._module = ["tests.reliability.faulty_recorder", str(folder)] if faulty else ["edge.cli.main"]
        self._ending = threading.Event()
        self._shapes: set[str] = set()
        self._write_config(recording or {}, drivers or {})

    def _write_config(self, recording: dict[str, Any], drivers: dict[str, dict[str, Any]]) -> None:
        livox, reach, gopro = (self.addresses[name] for name in SENSORS)
        tables: dict[str, dict[str, Any]] = {
            "livox": {"address": livox, "host_address": self.host, "discovery_address": "127.255.255.255"},
            "reach": {"endpoint": f"tcp:{reach}:9001"},
            "gopro": {"address": gopro, "host": self.host, "http_port": 8080, "stream_port": self.stream_port},
        }
        table = {
            "recording": {"folder": str(self.recordings), "min_free_mib": 0, "min_free_percent": 0.0, **recording},
            "control": {"socket": str(self.socket)},
            "sensors": {name: tables[name] | drivers.get(name, {}) for name in self.sensors},
        }
        self.config.write_text(toml_table.render(table), encoding="utf-8")

    def __enter__(self) -> Chain:
        threading.Thread(target=self._watch, daemon=True).start()
        try:
            for name in self.sensors if self._own_emulators else ():
                self.start_emulator(name)
            self.start_recorder()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End everything that still runs."""
        self._ending.set()
        if self.recorder is not None and self.recorder.poll() is None:
            self.recorder.kill()
            self.recorder.wait()
        for name in tuple(self.emulators):
            self.kill_emulator(name)

    def start_emulator(self, name: str, uptime_s: float = 4100.0, time_scale: float = 0.1) -> None:
        """uptime_s below 11: the LiDAR is still starting. time_scale: of everything that takes it time."""
        told = {
            "address": self.addresses[name],
            "port": 9001,
            "http_port": 8080,
            "stream_port": self.stream_port,
            "incarnation": self._incarnations[name],
            "serial": self._serial,
            "uptime_s": uptime_s,
            "time_scale": time_scale,
        }
        self._incarnations[name] += 1
        command = [sys.executable, "-m", "tests.reliability.emulator", name, str(self.folder), json.dumps(told)]
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        self.emulators[name] = process
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"

    def kill_emulator(self, name: str) -> None:
        """As a pulled plug."""
        process = self.emulators.pop(name)
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()

    def fault(self, name: str, *faults: str) -> None:
        """These faults of a sensor hold from now on, and no others."""
        beside = self.folder / f".{name}.faults"
        beside.write_text("\n".join(f"{name}:{fault}" for fault in faults))
        beside.replace(self.folder / f"{name}.faults")

    def truth(self, name: str) -> dict[str, Any]:
        """What an emulator sent, and what was done to it."""
        path = self.folder / f"{name}.truth"
        loaded: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
        return loaded

    def start_recorder(self) -> None:
        """Returns when it answers."""
        command = [*self.launcher, sys.executable, "-m", *self._module, "recorder", "--config", str(self.config)]
        with self.log.open("ab") as log:
            self.recorder = subprocess.Popen(command, cwd=ROOT, stderr=log, stdin=subprocess.DEVNULL)
        wait_for(self._answers)

    def kill_recorder(self) -> None:
        """As a pulled battery."""
        assert self.recorder is not None
        self.recorder.kill()
        self.recorder.wait()
        self.status = None

    def stop_recorder(self) -> int:
        """As systemd does. Returns its exit code."""
        assert self.recorder is not None
        self.recorder.send_signal(signal.SIGTERM)
        return self.recorder.wait(PATIENCE_S)

    def request(self, command: str, **words: str) -> Reply:
        """One request on a connection of its own."""
        with ControlClient(self.socket, timeout_s=PATIENCE_S) as client:
            return client.request(Request(command, **words))  # type: ignore[arg-type]

    def start(self) -> Path:
        """Begin a session; its folder."""
        return Path(self.request("start").folder)

    def stop(self) -> None:
        self.request("stop")

    def sensor(self, name: str) -> Sensor | None:
        """As the operator sees it now."""
        status = self.status
        return next((one for one in status.sensors if one.name == name), None) if status else None

    def state(self, name: str) -> str:
        sensor = self.sensor(name)
        return sensor.state if sensor else ""

    def received(self, name: str) -> int:
        """Messages of a sensor's first stream so far."""
        sensor = self.sensor(name)
        return sensor.streams[0].received if sensor and sensor.streams else 0

    def until_delivering(self, *names: str) -> None:
        """Until these sensors, or all, deliver."""
        for name in names or self.sensors:
            wait_for(lambda name=name: self.state(name) in DELIVERS and self.received(name) > 0)

    def until_more(self, count: int, *names: str) -> None:
        """Until so many more messages came from each of these sensors, or from all."""
        wanted = {name: self.received(name) + count for name in names or self.sensors}
        wait_for(lambda: all(self.received(name) >= least for name, least in wanted.items()))

    def until_told(self, words: str) -> str:
        """Until the operator reads this; the whole sentence."""
        wait_for(lambda: any(words in text for text in tuple(self.told)))
        return next(text for text in self.told if words in text)

    def until_verdict(self) -> tuple[str, tuple[str, ...]]:
        """Of the session just stopped."""
        wait_for(lambda: self.status and self.status.verdict and not self.status.verdict.running)
        assert self.status is not None
        assert self.status.verdict is not None
        return self.status.verdict.verdict, self.status.verdict.reasons

    def said(self) -> str:
        """The recorder's log."""
        return self.log.read_text(encoding="utf-8", errors="replace")

    def _answers(self) -> bool:
        assert self.recorder is not None
        assert self.recorder.poll() is None, self.said()
        try:
            with ControlClient(self.socket) as client:
                client.connect()
        except ControlError:
            return False
        return True

    def _watch(self) -> None:
        """Be the operator's screen, for as long as there is a recorder."""
        while not self._ending.wait(0.1):
            try:
                with ControlClient(self.socket) as client:
                    for status in client.subscribe():
                        self._read(status)
                        if self._ending.is_set():
                            return
            except ControlError:
                continue

    def _read(self, status: Status) -> None:
        self.status = status
        texts = [f"{one.name} {one.state}: {one.problem}. {one.advice}" for one in status.sensors if one.problem]
        for text in (*texts, *status.problems):
            shape = re.sub(r"\d+(\.\d+)?", "N", text)
            if shape not in self._shapes:
                self._shapes.add(shape)
                self.told.append(text)
