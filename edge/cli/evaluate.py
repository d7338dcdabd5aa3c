"""`mapforest evaluate`: estimates against ground truth."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.console import Console
from rich.table import Table

from edge.cli import exit_codes
from edge.cli.words import console
from edge.config import load
from edge.errors import EdgeError, UsageError
from edge.validation.clock_truth import ClockReport, clock_reports

if TYPE_CHECKING:  # heavy: scipy
    from pipeline.evaluation.pair import Pair

WHAT = ("clocks", "trajectory", "trees", "diameters", "alignment", "detection", "map")
_APART = {"detection": "edge.cli.detections", "alignment": "edge.cli.alignments", "map": "edge.cli.maps"}
"""These look at their arguments themselves."""
HELP = """compare estimates with ground truth

example: mapforest evaluate clocks demo/recordings/20261124T101500Z_demo --truth demo/truth
         mapforest evaluate trajectory demo/recordings/20261124T101500Z_demo --truth demo/truth
         mapforest evaluate trajectory demo/recordings/20261124T101500Z_demo --truth demo/truth --page plots.html
         mapforest evaluate trajectory estimate.tum --truth truth.tum --over 50
         mapforest evaluate trees demo/recordings/20261124T101500Z_demo --truth demo/truth
         mapforest evaluate alignment plot7_aligned --truth truth.txt
         mapforest evaluate diameters plot_inventory --truth field_list.csv --page diameters.html
         mapforest evaluate diameters demo/recordings/20261124T101500Z_demo --truth demo/truth
         mapforest evaluate detection models/ailanthus.onnx datasets/autumn --page curves.html --worst worst.jpg
         mapforest evaluate map recordings/20261124T101500Z_walk --control surveyed.csv
         mapforest evaluate map walk.laz --reference scanned.laz

clocks: offset and drift of each sensor's clock, estimated while recording, against the emulated payload's truth.
trajectory: what `mapforest process` made of a session and what the live pipeline recorded in it, or a TUM file, against
the emulated payload's truth or another TUM file in the same time: APE and RPE (as in evo) as it is, and laid over the
truth by yaw or in all axes; NEES (1 is honest). Live and offline are compared on the Earth: how far they are apart, and
whether their covariances allow for that.
trees: the trees that `mapforest process` mapped, against those of the simulated forest that the camera saw.
alignment: what `mapforest align` wrote (or a folder of many), against another alignment.json or a text of X Y Z YAW:
errors at the middle of the footprint, and over covariance (3 is expected of plan and turn together).
diameters: what `mapforest inventory` measured, against a field list (CSV with x, y, dbh_cm in the map's coordinates),
or a session's against the stems from 10 cm within 15 m of the emulated payload's way: MRE, RMSE, bias, completeness and
commission, a scatter plot.
detection: an ONNX model ("demo" for ours), or a folder of another program's predictions (YOLO texts with confidences),
against a folder with images/, labels/, classes.txt and, to be told by site, sites.csv (image,site): precision, recall
and F1 at one confidence, average precisions as COCO's, confusion, intervals from sites drawn anew.
map: a LAS, LAZ or PLY, or a session's, without truth: entropy, thickness of planes and of bark, and how far surfaces
are apart that passes at different times show; beside another map of the place (--reference); against surveyed points
of the ground (--control, a CSV with name,x,y,z in the map's coordinates)."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument(
        "what",
        choices=WHAT,
        help="what to evaluate",
    )
    parser.add_argument(
        "estimate",
        type=Path,
        help="session folder; trajectory: also products, or a TUM file; detection: model, or predictions; map: file",
    )
    parser.add_argument("dataset", type=Path, nargs="?", help="detection: labelled images")
    parser.add_argument(
        "--truth", type=Path, metavar="PATH", help="of the others: folder that the emulated payload wrote, or TUM file"
    )
    parser.add_argument(
        "--settle", type=float, default=10.0, metavar="S", help="clocks: leave out this much of an epoch"
    )
    parser.add_argument("--over", type=float, default=100.0, metavar="M", help="trajectory: stretches of the RPE")
    parser.add_argument("--page", type=Path, metavar="FILE", help="also write plots, as one HTML page")
    parser.add_argument(
        "--least", type=float, default=0.0, metavar="CM", help="diameters: leave thinner true stems out"
    )
    parser.add_argument("--worst", type=Path, metavar="FILE", help="detection: the worst images in one JPEG or PNG")
    parser.add_argument(
        "--confidence",
        type=float,
        metavar="C",
        help="detection: of the operating point (detection.confidence, else what the model advises)",
    )
    parser.add_argument("--reference", type=Path, metavar="MAP", help="map: another one of the place")
    parser.add_argument("--control", type=Path, metavar="CSV", help="map: surveyed points of the ground: name,x,y,z")
    parser.add_argument("--radius", type=float, default=0.3, metavar="M", help="map: around a point")
    parser.add_argument("--gap", type=float, default=30.0, metavar="S", help="map: this far apart are two passes")


def run(args: argparse.Namespace) -> int:
    """Print the comparison."""
    if args.what in _APART:
        command: Callable[[argparse.Namespace], int] = importlib.import_module(_APART[args.what]).run
        return command(args)
    if args.truth is None or args.dataset is not None:
        raise UsageError(f"evaluate {args.what}: give one session, and its truth with --truth")
    if args.what == "diameters":
        from edge.cli import diameters

        return diameters.run(args)
    if args.what == "trajectory":
        return _trajectory(args)
    if args.page is not None:
        raise UsageError("--page: there are plots of trajectories, diameters and detections only")
    if args.what == "trees":
        return _trees(args)
    reports = clock_reports(args.estimate, args.truth, args.settle)
    if args.json:
        print(msgspec.json.encode(reports).decode())
    else:
        Console().print(clock_table(reports))
    return exit_codes.GOOD


def _trajectory(args: argparse.Namespace) -> int:
    from edge.cli.trajectories import show
    from edge.process.against_truth import find_pairs
    from pipeline.evaluation.pair import compare

    pairs = find_pairs(args.estimate, args.truth, load(args.config))
    found = compare(pairs, args.over)
    if args.page is not None:
        _write_page(args.page, args.estimate, pairs)
    if args.json:
        print(msgspec.json.encode(found).decode())
    else:
        show(console(), found)
    return exit_codes.GOOD


def _trees(args: argparse.Namespace) -> int:
    from edge.cli.trees import show
    from edge.process.trees_against_truth import compare_trees

    found = compare_trees(args.estimate, args.truth, load(args.config).grounding.probable)
    if args.json:
        print(msgspec.json.encode(found).decode())
    else:
        show(console(), found)
    return exit_codes.GOOD


def _write_page(path: Path, session: Path, pairs: list[Pair]) -> None:
    from pipeline.products.comparison import write_comparison

    try:
        write_comparison(path, f"Trajectories of {session.absolute().name}", pairs)
    except OSError as error:
        raise EdgeError(f"{path}: cannot be written ({error.strerror}); give another place with --page") from error


def clock_table(reports: list[ClockReport]) -> Table:
    """The comparison for people."""
    table = Table(title="sensor clocks: estimated against true", title_justify="left", box=None)
    for column in ("sensor", "latency ms", "rms ms", "worst ms", "drift ppm", "true ppm", "in 3 sigma", "epochs"):
        table.add_column(column, justify="left" if column == "sensor" else "right")
    for report in reports:
        errors = report.errors
        table.add_row(
            report.sensor,
            f"{errors.latency_ms:.2f}",
            f"{errors.rms_ms:.3f}",
            f"{errors.worst_ms:.3f}",
            f"{errors.skew_ppm:.1f}",
            f"{errors.true_skew_ppm:.1f}",
            f"{errors.within_3_sigma:.0%}",
            str(errors.epochs),
        )
    return table
