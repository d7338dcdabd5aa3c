"""Memory and time of `mapforest process` over a recording of hours, made of laps of one simulated walk.

    python -m benchmarks.process --cache DIR --hours 2 [--scenario loop_1200]

The walk ends where it began, so laps follow each other; LiDAR, IMU and GNSS go into one .mcap of 7 GB an hour in DIR.
Memory is the process's own, read from /proc every second: by tenths of the odometry, then the most of each stage.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from benchmarks.fusion.table import received
from benchmarks.odometry.simulated import EPOCH_NS, SCAN_NS, Walk, walk
from benchmarks.recorded import write_recording
from benchmarks.watched import process
from drivers.messages import GnssFix, ImuSample, LidarScan
from drivers.sim.scenarios import scenario
from drivers.sim.world import build

SECOND_NS = 1_000_000_000


def main() -> None:
    options = _options()
    run = process(_recording(options), options.cache / "long_products")
    facts = run.facts
    print(f"{facts['duration_s']:.0f} s, {facts['travelled_m']:.0f} m, {facts['estimates']} sweeps")
    print(f"took {run.took_s:.0f} s: {facts['duration_s'] / run.took_s:.1f} times as fast as it was recorded")
    odometry = [sample.memory_mb for sample in run.of(0)]
    tenths = [max(odometry[k * len(odometry) // 10 : (k + 1) * len(odometry) // 10], default=0.0) for k in range(10)]
    print("odometry, MB by tenths: " + " ".join(f"{value:.0f}" for value in tenths))
    for stage, name in enumerate(("odometry", "fusion", "products")):
        print(f"{name}: at most {run.most_mb(stage):.0f} MB")


def _recording(options: argparse.Namespace) -> Path:
    path = options.cache / f"long_{options.scenario}_{options.hours:g}h.mcap"
    if not path.exists():
        world = build(scenario(options.scenario, 1))
        one = walk(world.config, options.cache)
        fixes = received(world, "honest", 1)
        write_recording(path, _laps(one, fixes, int(options.hours * 3600 * SECOND_NS)))
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
