"""Memory and time of `mapforest process` over a recording of hours, made of laps of one simulated walk.

    python -m benchmarks.process --cache DIR --hours 2 [--scenario loop_1200]

The walk ends where it began, so laps follow each other; LiDAR, IMU and GNSS go into one .mcap of 7 GB an hour in DIR.
Memory is the process's own, read from /proc every second: by tenths of the odometry, then the most of each stage.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
from mcap.writer import CompressionType, Writer

from benchmarks.fusion.table import received
from benchmarks.odometry.simulated import EPOCH_NS, SCAN_NS, Walk, walk
from drivers.messages import GnssFix, ImuSample, LidarScan
from drivers.sim.scenarios import scenario
from drivers.sim.world import build
from edge.config import Topics
from edge.ros.encode import ENCODERS
from edge.ros.schemas import schema_text
from edge.ros.topics import channels

SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Sample:
    """stages: how many are finished."""

    after_s: float
    stages: int
    memory_mb: float


def main() -> None:
    options = _options()
    source = _recording(options)
    output = options.cache / "long_products"
    command = [sys.executable, "-m", "edge.cli.main", "process", str(source), "--output", str(output), "--fresh"]
    begun_s = time.monotonic()
    process = subprocess.Popen([*command, "--json"], stdout=subprocess.PIPE, text=True)
    samples = list(_watched(process, output / "work" / "state.json"))
    text, _ = process.communicate()
    took_s = time.monotonic() - begun_s
    facts = msgspec.json.decode(text)
    print(f"{facts['duration_s']:.0f} s, {facts['travelled_m']:.0f} m, {facts['estimates']} sweeps")
    print(f"took {took_s:.0f} s: {facts['duration_s'] / took_s:.1f} times as fast as it was recorded")
    odometry = [sample.memory_mb for sample in samples if sample.stages == 0]
    tenths = [max(odometry[k * len(odometry) // 10 : (k + 1) * len(odometry) // 10], default=0.0) for k in range(10)]
    print("odometry, MB by tenths: " + " ".join(f"{value:.0f}" for value in tenths))
    for stage, name in enumerate(("odometry", "fusion", "products")):
        most = max((sample.memory_mb for sample in samples if sample.stages == stage), default=0.0)
        print(f"{name}: at most {most:.0f} MB")


def _watched(process: subprocess.Popen[str], state: Path) -> Iterator[Sample]:
    begun_s = time.monotonic()
    while process.poll() is None:
        status = Path(f"/proc/{process.pid}/status")
        try:
            resident = status.read_text(encoding="ascii").split("VmRSS:")[1].split()[0]
            stages = len(msgspec.json.decode(state.read_bytes())["stages"]) if state.exists() else 0
        except (OSError, IndexError):
            break  # it ended between the two looks
        yield Sample(time.monotonic() - begun_s, stages, int(resident) / 1024.0)
        time.sleep(1.0)


def _recording(options: argparse.Namespace) -> Path:
    path = options.cache / f"long_{options.scenario}_{options.hours:g}h.mcap"
    if path.exists():
        return path
    world = build(scenario(options.scenario, 1))
    one = walk(world.config, options.cache)
    fixes = received(world, "honest", 1)
    draft = path.with_suffix(".draft")
    with draft.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start("ros2", "mapforest")
        used = channels(Topics())
        ids = {}
        for kind in (LidarScan, ImuSample, GnssFix):
            channel = used[kind]
            schema = writer.register_schema(channel.type_name, "ros2msg", schema_text(channel.type_name))
            ids[kind] = writer.register_channel(channel.topic, "cdr", schema)
        for message in _laps(one, fixes, int(options.hours * 3600 * SECOND_NS)):
            writer.add_message(
                ids[type(message)],
                log_time=message.receive_ns,
                data=ENCODERS[type(message)](message, message.stamp_ns),
                publish_time=message.stamp_ns,
            )
        writer.finish()
    draft.replace(path)
    return path


def _laps(one: Walk, fixes: list[GnssFix], length_ns: int) -> Iterator[LidarScan | ImuSample | GnssFix]:
    lap_ns, begun_ns = one.scan_count * SCAN_NS, 0
    imu = one.imu()
    while begun_ns < length_ns:
        next_sample, next_fix = 0, 0
        for scan in one.scans():
            end_ns = scan.stamp_ns + SCAN_NS
            while next_sample < len(imu) and imu[next_sample].stamp_ns < min(end_ns, EPOCH_NS + lap_ns):
                yield _later(imu[next_sample], begun_ns)
                next_sample += 1
            while next_fix < len(fixes) and fixes[next_fix].stamp_ns + EPOCH_NS < end_ns:
                yield _later(fixes[next_fix], begun_ns + EPOCH_NS)
                next_fix += 1
            yield _later(scan, begun_ns)
            if scan.stamp_ns - EPOCH_NS + begun_ns > length_ns:
                return
        begun_ns += lap_ns


def _later(message, by_ns: int):
    return replace(message, stamp_ns=message.stamp_ns + by_ns, receive_ns=message.receive_ns + by_ns)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks and the recording are kept")
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--scenario", default="loop_1200", help="a walk that ends where it began")
    return parser.parse_args()


if __name__ == "__main__":
    main()
