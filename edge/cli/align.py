"""`mapforest align`: a ground map onto an aerial one."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.console import Console
from rich.markup import escape

from edge import __version__
from edge.cli import exit_codes
from edge.cli.stage_bar import StageBar
from edge.cli.words import console
from edge.errors import EdgeError, UsageError

if TYPE_CHECKING:  # heavy: numba
    from pipeline.alignment.result import Result
    from pipeline.alignment.task import Task
    from pipeline.alignment.transform import Transform

HELP = """bring a ground map onto an aerial one, which also takes the GNSS bias off

example: mapforest align lidar_2024.laz recordings/20261124T101500Z_walk/products/map.laz
         mapforest align lidar_2024.laz plot7.ply --start 470640,3810235,12 --search 20
         mapforest align lidar_2024.laz stems.csv --trees trees.gpkg --trees detections.csv
         mapforest align monday.laz tuesday.laz --sessions

AERIAL: LAS or LAZ in a projected coordinate system in metres, reaching past the ground map by the search.
TERRESTRIAL: LAS, LAZ or PLY, level; or a CSV of stems with x, y and, better, dbh_cm.
Writes alignment.json (transform, covariance, verdict), alignment.html and fields_*.png, and if the answer is sure,
merged.laz and the tables of --trees in the frame of the aerial map. Where the maps cannot tell, it says so and ends
with 3: nothing is moved then."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("aerial", type=Path, help="aerial point cloud")
    parser.add_argument("terrestrial", type=Path, help="ground map, or table of stems")
    parser.add_argument("--output", type=Path, metavar="DIR", help="default: TERRESTRIAL_aligned beside it")
    parser.add_argument(
        "--start",
        metavar="X,Y[,YAW]",
        help="where a local map's origin lies in the aerial frame; degrees from its x axis",
    )
    parser.add_argument("--crs", metavar="EPSG:CODE", help="of maps that name no coordinate system")
    parser.add_argument("--search", type=float, default=10.0, metavar="M", help="greatest shift (default 10)")
    parser.add_argument("--turn", type=float, default=35.0, metavar="DEG", help="greatest turn (default 35; 180: any)")
    parser.add_argument(
        "--trees", type=Path, action="append", default=[], metavar="FILE", help="CSV or GeoPackage to move"
    )
    parser.add_argument("--least-dbh", type=float, default=0.0, metavar="CM", help="leave thinner stems of a CSV out")
    parser.add_argument(
        "--method", choices=["joint", "nmi"], default="joint", help="nmi: the published one, stems alone"
    )
    parser.add_argument("--lobe", choices=["positive", "absolute"], default="positive", help="of the Laplacian")
    parser.add_argument(
        "--device",
        default="cpu",
        metavar="NAME",
        help="cuda: score poses by PyTorch on a GPU, for wide searches of nmi",
    )
    parser.add_argument(
        "--sessions", action="store_true", help="both are ground maps: any turn, any shift, stems on stems"
    )
    parser.add_argument("--no-merge", action="store_true", help="leave merged.laz out")


def run(args: argparse.Namespace) -> int:
    """Warnings when it is not enough to tell."""
    from pipeline.alignment.errors import AlignmentError
    from pipeline.alignment.result import ALIGNED, result
    from pipeline.alignment.task import run as align
    from pipeline.products.aligned import write_aligned

    task = _task(args)
    folder = args.output or args.terrestrial.with_name(f"{args.terrestrial.stem}_aligned")
    out = console(stderr=args.json)
    try:
        with StageBar(quiet=args.json) as bar:

            def stage(name: str) -> Callable[[float], None]:
                bar.stage(name, done=False)
                return bar.advance

            done = align(task, stage)
            found = result(done, __version__)
            files = write_aligned(folder, done, found, args.trees, stage, merge=not args.no_merge)
    except AlignmentError as error:
        raise EdgeError(str(error)) from error
    except OSError as error:
        raise EdgeError(f"{folder}: cannot be written ({error.strerror}); give another place with --output") from error
    if args.json:
        print(msgspec.json.encode({"folder": str(folder), **msgspec.to_builtins(found)}).decode())
    else:
        _show(out, found)
        for name, meaning in files.items():
            out.print(f"  {escape(str(folder / name))}  [dim]{escape(meaning)}[/]", highlight=False, soft_wrap=True)
    return exit_codes.GOOD if found.verdict == ALIGNED else exit_codes.WARNINGS


def _show(out: Console, found: Result) -> None:
    good = not found.doubts
    tone = "green" if good else "yellow"
    height = "" if found.z_m is None else f", {found.z_m:+.2f} ± {found.sigma_z_m:.2f} m up"
    out.print(
        f"[bold {tone}]{found.verdict}[/]: {found.x_m:+.2f} m east, {found.y_m:+.2f} m north, {found.yaw_deg:+.2f}° "
        f"± {found.sigma_m:.2f} m, {found.sigma_deg:.2f}°{height}; {found.margin_nats:.1f} nats ahead of the next, "
        f"{found.asked_nats:.1f} asked for",
        highlight=False,
    )
    for line in (*found.doubts, *found.notes):
        out.print(f"  {escape(line)}", highlight=False)


def _task(args: argparse.Namespace) -> Task:
    from pipeline.alignment.config import AlignmentConfig
    from pipeline.alignment.task import Task

    if not args.search > 0.0 or not 0.0 < args.turn <= 180.0:
        raise UsageError(
            f"--search {args.search:g} --turn {args.turn:g}: metres above 0, and degrees up to 180, are expected"
        )
    config = AlignmentConfig(
        search_m=args.search, search_deg=args.turn, method=args.method, lobe=args.lobe, device=args.device
    )
    start = _start(args.start) if args.start is not None else None
    return Task(args.aerial, args.terrestrial, config, start, args.crs, args.least_dbh, args.sessions)


def _start(text: str) -> Transform:
    from pipeline.alignment.transform import Transform

    try:
        x, y, *yaw = (float(word) for word in text.split(","))
    except ValueError:
        yaw = [0.0, 0.0]
    if len(yaw) > 1:
        raise UsageError(f"--start {text}: two or three numbers are expected, X,Y or X,Y,YAW, in metres and degrees")
    return Transform((0.0, 0.0), x, y, 0.0, yaw[0] if yaw else 0.0)
