"""`python -m benchmarks.recording`: measure, print one table, exit 1 when a target is missed."""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import platform
import sys
import tempfile
from pathlib import Path

from benchmarks.recording.cpu import load_average
from benchmarks.recording.encode import encode_cores
from benchmarks.recording.load import Load
from benchmarks.recording.report import Results, rows, text
from benchmarks.recording.start import starts
from benchmarks.recording.trial import Trial, record
from benchmarks.recording.writers import Recorded, capture, compare

PARTS = ("1x", "5x", "start", "writers")


def main() -> int:
    """Exit code: 0 all targets met, 1 one missed."""
    args = _parser().parse_args()
    with tempfile.TemporaryDirectory(prefix="mapforest-bench-", dir=args.folder) as made:
        results = _measure(args, Path(made))
    print(text(results))
    if args.json:
        args.json.write_text(json.dumps(dataclasses.asdict(results), indent=2) + "\n", encoding="utf-8")
    return 1 if any(row.met is False for row in rows(results)) else 0


def _measure(args: argparse.Namespace, folder: Path) -> Results:
    trials: list[Trial] = []
    recorded: list[Recorded] = []
    machine = f"{os.cpu_count()} x {_processor()}, Python {platform.python_version()}"
    results = Results(machine, load_average())
    if "1x" in args.parts or "writers" in args.parts:
        seconds = max(args.seconds, 60 * args.memory_minutes) if "1x" in args.parts else args.seconds
        _say(f"recording at 1x for {seconds:.0f} s")
        trials.append(
            record(folder, Load(1), seconds, inspect=lambda made: recorded.extend(capture(made, args.seconds)))
        )
    if "5x" in args.parts:
        _say(f"recording at 5x for {args.seconds:.0f} s")
        trials.append(record(folder, Load(5), args.seconds))
    if "start" in args.parts:
        _say(f"starting {args.starts} sessions")
        results = dataclasses.replace(results, starts=tuple(starts(folder, Load(1), args.starts)))
    if "writers" in args.parts:
        _say(f"writing {len(recorded)} recorded messages with each writer")
        costs = tuple(compare(folder / "writers", recorded, args.runs, args.paced))
        results = dataclasses.replace(results, encode=encode_cores(recorded), writers=costs)
    return dataclasses.replace(results, trials=tuple(trials))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recording", description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="length of each recording (default 30)")
    parser.add_argument(
        "--memory-minutes", type=float, default=1.0, help="length of that at 1x (default 1; 10 to judge)"
    )
    parser.add_argument("--starts", type=int, default=5, help="sessions started for the start key (default 5)")
    parser.add_argument("--runs", type=int, default=3, help="runs of each writer (default 3)")
    parser.add_argument("--paced", type=float, default=10.0, help="seconds written in real time (default 10, 0: none)")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="what to measure (default all)")
    parser.add_argument("--folder", type=Path, help="where to record (default the folder for temporary files)")
    parser.add_argument("--json", type=Path, help="file for all figures")
    return parser


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _say(step: str) -> None:
    print(step, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
