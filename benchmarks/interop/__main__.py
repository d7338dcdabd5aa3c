"""`python -m benchmarks.interop SESSION --peers-python PY --node NODE_MODULES`: other programs open a session folder.

The peers are installed apart from this program, since they pin other versions of what it needs:

    python3 -m venv peers && peers/bin/pip install kiss-icp "rko_lio[all]"
    npm install --prefix peers @mcap/core
    python -m benchmarks.interop demo/recordings/*_demo --peers-python peers/bin/python --node peers/node_modules

Nothing is converted or copied. KISS-ICP is given the folder and takes its ROS bag loader: its own loader of single MCAP
files fails on any PointCloud2 with today's mcap-ros2-support, whoever wrote the file. Exit code 1 when a count differs.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from benchmarks.interop import peers
from benchmarks.interop.peers import Asked, PeerFailed
from edge.recording.bag import counts_by_topic, read_facts

Counts: TypeAlias = dict[str, int]


@dataclass(frozen=True, slots=True)
class Check:
    """expected: of the topics this program is to read."""

    program: str
    ask: Callable[[Asked], Counts]
    expected: Counts


def main() -> int:
    """Exit code: 0 all counts equal ours, 1 not."""
    asked = _asked(_parser().parse_args())
    ours = counts_by_topic(read_facts(Path(path))[0] for path in asked.files)
    if not ours:
        print(f"{asked.session}: no messages in it", file=sys.stderr)
        return 1
    print(f"{asked.session.name}: " + ", ".join(f"{topic} {count}" for topic, count in sorted(ours.items())))
    passed = [_passes(check, asked) for check in _checks(asked, ours)]
    return 0 if all(passed) else 1


def _checks(asked: Asked, ours: Counts) -> list[Check]:
    scans = {asked.lidar: ours.get(asked.lidar, 0)}
    some = {asked.lidar: min(asked.scans, scans[asked.lidar])}
    return [
        Check("rosbags, folder", peers.rosbags_folder, ours),
        Check("rosbags, single files", peers.rosbags_files, ours),
        Check("@mcap/core", peers.node, ours),
        Check("kiss_icp, loader", peers.kiss_icp_loader, scans),
        Check("kiss_icp_pipeline", peers.kiss_icp, some),
        Check("rko_lio", peers.rko_lio, scans),
    ]


def _passes(check: Check, asked: Asked) -> bool:
    """Ask, and print one line."""
    start_s = time.monotonic()
    try:
        found = check.ask(asked)
    except PeerFailed as error:
        print(f"FAIL  {check.program:22} {error}", flush=True)
        return False
    took = f"{time.monotonic() - start_s:.1f} s"
    differing = _differences(check.expected, found)
    told = differing or f"{sum(found.values())} of {sum(check.expected.values())} messages on {len(found)} topics"
    print(f"{'FAIL' if differing else 'PASS'}  {check.program:22} {told} ({took})", flush=True)
    return not differing


def _differences(expected: Counts, found: Counts) -> str:
    topics = sorted({*expected, *found})
    ours, theirs = Counter(expected), Counter(found)
    return ", ".join(f"{topic} {theirs[topic]} of {ours[topic]}" for topic in topics if theirs[topic] != ours[topic])


def _asked(args: argparse.Namespace) -> Asked:
    return Asked(args.session, args.peers_python, args.node, args.lidar, args.imu, args.scans, args.timeout)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.interop",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("session", type=Path, help="a session folder with metadata.yaml")
    parser.add_argument("--peers-python", type=Path, required=True, help="Python of the peers' environment")
    parser.add_argument("--node", type=Path, required=True, help="node_modules with @mcap/core")
    parser.add_argument("--lidar", default="/livox/lidar", help="topic of the scans (default %(default)s)")
    parser.add_argument("--imu", default="/livox/imu", help="topic of the IMU (default %(default)s)")
    parser.add_argument("--scans", type=int, default=50, help="scans for kiss_icp_pipeline (default %(default)s)")
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds a program may take (default %(default)s)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
