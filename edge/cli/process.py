"""`mapforest process`: the onboard pipeline over a recording."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.markup import escape

from edge.cli import exit_codes
from edge.cli.stage_bar import StageBar
from edge.cli.words import console
from edge.config import load
from edge.errors import UsageError
from edge.words import duration

if TYPE_CHECKING:  # heavy: numpy, numba
    from edge.process.product_facts import ProductFacts
    from edge.replay.geometry import Matrix

HELP = """odometry, GNSS fusion, detection and products from a recording, faster than real time

example: mapforest process recordings/20261124T101500Z_walk
         mapforest process recordings/20261124T101500Z_walk --detect models/ailanthus.onnx
         mapforest process walk.mcap --output walk --lidar /ouster/points --imu /ouster/imu

Takes sessions of mapforest, and recordings of ROS 2 in MCAP: PointCloud2 or Livox CustomMsg with the time of each
point, an IMU in m/s^2 or g, NavSatFix. Interrupted, it goes on at the stage it was in;
what is done is not done again."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("recording", type=Path, nargs="+", help="session folder, bag folder, or .mcap files in order")
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help="where the products go (default: beside the recording)"
    )
    parser.add_argument("--no-gnss", action="store_true", help="leave the fixes out: a local map")
    parser.add_argument(
        "--detect",
        metavar="MODEL",
        help='ONNX file of the detector, "demo" for ours, "" for none (default: detection.model, or as the last time)',
    )
    parser.add_argument("--fresh", action="store_true", help="do again what was done before")
    parser.add_argument("--clean", action="store_true", help="take the files between the stages away at the end")
    parser.add_argument("--lidar", default="", metavar="TOPIC", help="topic of the point clouds")
    parser.add_argument("--imu", default="", metavar="TOPIC", help="topic of the inertial data")
    parser.add_argument("--fix", default="", metavar="TOPIC", help="topic of the GNSS fixes")
    parser.add_argument("--time-field", default="", metavar="NAME", help="field of a point that holds its time")
    parser.add_argument(
        "--lidar-pose", metavar="X,Y,Z,QX,QY,QZ,QW", help="pose of the LiDAR in the frame of the IMU, metres"
    )


def run(args: argparse.Namespace) -> int:
    """Warnings when there is something to look at: no georeference, damage, sweeps without an estimate."""
    from edge.process.looked_with import looked_with
    from edge.process.process import Task, clean, process
    from edge.replay.replay import ReplayOptions
    from edge.replay.topics import Wanted

    logging.getLogger("pyogrio").setLevel(logging.WARNING)  # it counts every record it writes
    options = ReplayOptions(Wanted(args.lidar, args.imu, args.fix), args.time_field, _pose(args.lidar_pose))
    task = Task(args.recording, args.output, not args.no_gnss, args.fresh, options)
    out = console(stderr=args.json)
    with StageBar(quiet=args.json) as bar:
        done = process(task, looked_with(load(args.config), args.detect, [task.folder]), bar)
    if args.clean:
        clean(task)
    facts = done.facts
    if args.json:
        print(
            msgspec.json.encode(
                {"folder": str(done.folder), "redone": done.redone, **msgspec.to_builtins(facts)}
            ).decode()
        )
    else:
        out.print(f"[bold]{escape(facts.session)}[/]: {_told(facts, done.redone)}", highlight=False)
        for note in facts.notes:
            out.print(f"  {escape(note)}", highlight=False)
        for name, meaning in facts.files.items():
            out.print(f"  {escape(str(done.folder / name))}  [dim]{escape(meaning)}[/]", highlight=False)
    poor = facts.datum is None and not args.no_gnss
    return exit_codes.WARNINGS if poor or facts.estimates < 0.9 * facts.sweeps else exit_codes.GOOD


def _told(facts: ProductFacts, redone: tuple[str, ...]) -> str:
    speed = facts.duration_s / facts.odometry_seconds if facts.odometry_seconds else 0.0
    pace = f", odometry {speed:.1f} times as fast as it was recorded" if "odometry" in redone else ""
    return (
        f"{facts.travelled_m:,.1f} m in {duration(facts.duration_s)}, {facts.points:,} points, {facts.crs}, sigma at "
        f"the end {facts.sigma_end_m:.2f} m{pace or ('' if redone else '; nothing had changed since the last run')}"
    )


def _pose(text: str | None) -> Matrix | None:
    if text is None:
        return None
    from edge.replay.geometry import pose_matrix

    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 7 or abs(sum(value * value for value in numbers[3:]) - 1.0) > 1e-3:
        raise UsageError(f"--lidar-pose {text}: seven numbers are expected, x,y,z and a unit quaternion qx,qy,qz,qw")
    return pose_matrix(numbers[:3], numbers[3:])
