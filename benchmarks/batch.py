"""Eight short sessions one by one, by two workers, and by two workers with a broken session and a killed worker.

    python -m benchmarks.batch [make] [serial] [batch] [faults] [table] --cache DIR [--seeds 1 2 3 4 5 6 7 8]

Each part alone, or all in turn; what a part measured is kept in DIR. Sessions are the beginnings of simulated walks:
LiDAR, IMU, GNSS. `serial` takes one after the other in one process, so that it pays for loading and compiling once.
`faults` writes rubbish over one recording, and kills the process of a worker by its id while it works. Products are
compared file by file; of products.json without what tells the time it took, of GeoPackages the layers' records, which
leaves out the time that stands in each file.
"""

from __future__ import annotations

import argparse
import hashlib
import heapq
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyogrio.raw

from benchmarks.fusion.table import received
from benchmarks.odometry.simulated import EPOCH_NS, walk
from benchmarks.recorded import Message, write_recording
from drivers.sim.scenarios import scenario
from drivers.sim.world import build
from edge.batch.plan import plan
from edge.batch.work import work
from edge.config import Config
from edge.process.watch import Watch

WORKERS, LENGTH_S = 2, 15.0
BROKEN, KILLED = 2, 3
"""Which of the sessions is rubbish; which one has begun when a worker is killed a moment later."""
TIMED = {"odometry_seconds"}
PARTS = ("make", "serial", "batch", "faults", "table")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where sessions and products are kept")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(1, 9)), help="of the walks; four at least")
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; all in turn where none is named")
    options = parser.parse_args()
    cache, names = options.cache, [f"walk_{seed}" for seed in options.seeds]
    for part in options.parts or PARTS:
        if part == "make":
            make(cache, options.seeds)
        else:
            {"serial": serial, "batch": batch, "faults": faults, "table": table}[part](cache, names)


def make(cache: Path, seeds: list[int]) -> None:
    """The sessions, once for each run: hard links of the same files."""
    for seed in seeds:
        path = cache / "recordings" / f"walk_{seed}" / f"walk_{seed}_0.mcap"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_recording(path, _messages(seed, cache))
        for run in ("serial", "batch", "faults"):
            other = cache / run / path.parent.name / path.name
            other.parent.mkdir(parents=True, exist_ok=True)
            if not other.exists():
                os.link(path, other)
    broken = next((cache / "faults" / f"walk_{seeds[BROKEN]}").glob("*.mcap"))
    broken.unlink()
    broken.write_bytes(b"rubbish" * 1000)


def _messages(seed: int, cache: Path) -> Iterator[Message]:
    world = build(scenario("demo", seed))
    cast = walk(world.config, cache, LENGTH_S)
    end_ns = EPOCH_NS + int(LENGTH_S * 1e9)
    fixes = (
        replace(fix, stamp_ns=fix.stamp_ns + EPOCH_NS, receive_ns=fix.receive_ns + EPOCH_NS)
        for fix in received(world, "honest", seed + 10)
        if fix.stamp_ns + EPOCH_NS < end_ns
    )
    return heapq.merge(cast.imu(), cast.scans(), fixes, key=lambda message: message.receive_ns)


def serial(cache: Path, names: list[str]) -> None:
    """In this process; broken off, it goes on with the next session."""
    noted, begun_s, cpu_s = cache / "serial.json", time.monotonic(), time.process_time()
    before = json.loads(noted.read_text()) if noted.exists() else {"took_s": 0.0, "cpu_s": 0.0, "sessions": []}
    for name in names:
        if name not in before["sessions"]:
            for step in plan(cache / "serial" / name, refine=True):
                work(step, Config(), Watch())
            before["sessions"].append(name)
            took = {"took_s": time.monotonic() - begun_s, "cpu_s": time.process_time() - cpu_s}
            _note(cache, "serial", before | {what: before[what] + seconds for what, seconds in took.items()})


def batch(cache: Path, _names: list[str]) -> None:
    """Undisturbed."""
    _note(cache, "batch", _run(cache / "batch"))


def faults(cache: Path, names: list[str]) -> None:
    """Disturbed, then once more: what is done must be found done."""
    told = _run(cache / "faults", f"{names[KILLED]}: process begins")
    told["again"] = _run(cache / "faults")
    _note(cache, "faults", told)


def _run(directory: Path, kill_at: str = "") -> dict[str, Any]:
    """kill_at: when this line is seen, a worker is killed a moment later."""
    command = [sys.executable, "-m", "edge.cli.main", "batch", str(directory), "--workers", str(WORKERS), "--json"]
    begun_s = time.monotonic()
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert running.stderr is not None
    assert running.stdout is not None
    killed, lines = 0, []
    for line in running.stderr:
        lines.append(line.rstrip())
        print(lines[-1], flush=True)
        if kill_at and not killed and line.startswith(kill_at):
            time.sleep(2.0)
            killed = _worker(running.pid)
            os.kill(killed, signal.SIGKILL)
    outcomes = json.loads(running.stdout.read())
    took_s = time.monotonic() - begun_s
    return {"took_s": took_s, "rc": running.wait(), "killed": killed, "lines": lines, "outcomes": outcomes}


def _worker(parent: int) -> int:
    """The worker that holds most memory: it is at work."""
    threads = Path(f"/proc/{parent}/task").iterdir()
    children = [pid for thread in threads for pid in (thread / "children").read_text(encoding="ascii").split()]
    return max(map(int, children), key=lambda pid: int(Path(f"/proc/{pid}/statm").read_text().split()[1]))


def table(cache: Path, names: list[str]) -> None:
    """What was measured."""
    one, two, three = (json.loads((cache / f"{name}.json").read_text()) for name in ("serial", "batch", "faults"))
    print(f"one by one: {one['took_s']:.0f} s, of them {one['cpu_s']:.0f} s of processor time")
    times = one["took_s"] / two["took_s"]
    print(f"{WORKERS} workers: {two['took_s']:.0f} s, {times:.2f} times as fast, exit {two['rc']}")
    print(f"with faults: {three['took_s']:.0f} s, worker {three['killed']} killed, exit {three['rc']}")
    for line in three["lines"]:
        if "FAILED" in line or "again" in line:
            print(f"  {line}")
    again = three["again"]
    redone = sum(bool(done["redone"]) for outcome in again["outcomes"] for done in outcome["done"].values())
    print(f"once more: {again['took_s']:.0f} s, {redone} stages done again")
    for run in ("batch", "faults"):
        broken = names[BROKEN] if run == "faults" else ""
        same, other = _compare(cache / "serial", cache / run, broken)
        print(f"{run}: {same} files are those of one by one, {len(other)} are not: {', '.join(other) or '-'}")


def _compare(left: Path, right: Path, broken: str) -> tuple[int, list[str]]:
    """broken: a session that has no products on the right."""
    first, second = _digests(left), _digests(right)
    if broken:
        first = {name: digest for name, digest in first.items() if not name.startswith(f"{broken}/")}
    names = sorted(first.keys() | second.keys())
    other = [name for name in names if first.get(name) != second.get(name)]
    return len(names) - len(other), other


def _digests(run: Path) -> dict[str, str]:
    files = [path for path in sorted(run.glob("*/products/**/*")) if path.is_file() and "work" not in path.parts]
    return {str(path.relative_to(run)): hashlib.sha256(_content(path)).hexdigest() for path in files}


def _content(path: Path) -> bytes:
    if path.suffix == ".gpkg":
        layers = [name for name, _ in pyogrio.list_layers(path)]
        return repr([_records(path, layer) for layer in layers]).encode()
    if path.name != "products.json":
        return path.read_bytes()
    facts = json.loads(path.read_text(encoding="utf-8"))
    return json.dumps({key: value for key, value in facts.items() if key not in TIMED}, sort_keys=True).encode()


def _records(path: Path, layer: str) -> list[Any]:
    meta, _, shapes, fields = pyogrio.raw.read(path, layer=layer)
    return [layer, list(meta["fields"]), list(shapes or ()), [values.tolist() for values in fields]]


def _note(cache: Path, name: str, told: dict[str, Any]) -> None:
    (cache / f"{name}.json").write_text(json.dumps(told, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
