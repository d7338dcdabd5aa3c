"""One emulated sensor as a process: `python -m tests.reliability.emulator SENSOR FOLDER JSON`.

Faults are read from `FOLDER/SENSOR.faults` whenever that changes, and what was sent and what was done to it is
written to `FOLDER/SENSOR.truth`. It says "ready" once its ports are open, and ends with SIGTERM.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from drivers.sim.faults import Fault, FaultPlan, parse
from drivers.sim.gopro_emulator import Emulator as Camera
from drivers.sim.livox_device import DeviceOptions
from drivers.sim.livox_emulator import Emulator as Lidar
from drivers.sim.reach_emulator import ReachSettings, Receiver, TcpServer
from tests.drivers.sources import Eastward
from tests.reliability.sources import NumberedVideo, Numbers

TRUTH_S = 0.1
LOOK_S = 0.05


class LivePlan(FaultPlan):
    """Faults as a file says them now: one a line, active as long as they stand there."""

    def __init__(self, sensor: str, path: Path) -> None:
        super().__init__(sensor, ())
        self._sensor, self._path = sensor, path
        self._looked_s, self._seen_ns = 0.0, 0

    def _active(self, kind: str, t_s: float) -> list[Fault]:
        now_s = time.monotonic()
        if now_s - self._looked_s > LOOK_S and self._path.exists():
            self._looked_s = now_s
            changed_ns = self._path.stat().st_mtime_ns
            if changed_ns != self._seen_ns:
                self._seen_ns = changed_ns
                self._faults = tuple(parse(line) for line in self._path.read_text().split())
        return list(super()._active(kind, t_s))


def lidar(plan: FaultPlan, told: dict, stop: threading.Event) -> tuple[Callable[[], None], Callable[[], dict]]:
    source = Numbers(told["incarnation"])
    options = DeviceOptions(time_scale=told["time_scale"], serial=told["serial"], uptime_s=told["uptime_s"])
    emulator = Lidar(source, source, plan, time.monotonic_ns(), address=told["address"], options=options)

    def truth() -> dict:
        if not hasattr(emulator, "imu"):
            return {}
        return {
            "points": asdict(emulator.points.tally),
            "imu": asdict(emulator.imu.tally),
            "skipped": emulator._point_stream.skipped,
            "reboots": emulator.device.machine.reboots,
        }

    return lambda: emulator.run(stop, None, ready), truth


def receiver(plan: FaultPlan, told: dict, stop: threading.Event) -> tuple[Callable[[], None], Callable[[], dict]]:
    port = TcpServer(told["address"], told["port"])
    port.open()
    emulator = Receiver(Eastward(), plan, time.monotonic_ns(), [port], ReachSettings())

    def run() -> None:
        ready()
        emulator.run(stop)

    return run, dict


def camera(plan: FaultPlan, told: dict, stop: threading.Event) -> tuple[Callable[[], None], Callable[[], dict]]:
    source, epoch_ns = NumberedVideo(told["incarnation"]), time.monotonic_ns()
    source.access_unit(0)
    emulator = Camera(source, plan, epoch_ns, told["address"], told["http_port"], told["stream_port"])

    def run() -> None:
        emulator.start()
        ready()
        stop.wait()
        emulator.stop()

    return run, lambda: {"sent": emulator.sent, "recording": emulator.device.recording}


def ready() -> None:
    sys.stdout.write("ready\n")
    sys.stdout.flush()


def main(sensor: str, folder: Path, told: dict) -> None:
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    plan = LivePlan(sensor, folder / f"{sensor}.faults")
    run, truth = {"livox": lidar, "reach": receiver, "gopro": camera}[sensor](plan, told, stop)
    path = folder / f"{sensor}.truth"

    def report() -> None:
        while not stop.wait(TRUTH_S):
            beside = path.with_suffix(".new")
            beside.write_text(json.dumps(truth()))
            beside.replace(path)

    threading.Thread(target=report, daemon=True).start()
    run()


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), json.loads(sys.argv[3]))
