"""`mapforest evaluate`: estimates against ground truth."""

from __future__ import annotations

import argparse
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.console import Console
from rich.table import Table

from edge.cli import exit_codes
from edge.cli.words import console
from edge.validation.clock_truth import ClockReport, clock_reports

if TYPE_CHECKING:  # heavy: scipy
    from edge.process.against_truth import Compared

HELP = """compare estimates with ground truth

example: mapforest evaluate clocks demo/recordings/20261124T101500Z_demo --truth demo/truth
         mapforest evaluate trajectory demo/recordings/20261124T101500Z_demo --truth demo/truth
         mapforest evaluate trajectory estimate.tum --truth truth.tum --over 50

clocks: offset and drift of each sensor's clock, estimated while recording, against the emulated payload's truth.
trajectory: what `mapforest process` made of a session, or a TUM file, against the emulated payload's truth or another
TUM file in the same time: APE and RPE (as in evo) as it is, and laid over the truth by yaw or in all axes; NEES."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("what", choices=["clocks", "trajectory"], help="what to evaluate")
    parser.add_argument("session", type=Path, help="session folder; trajectory: also products, or a TUM file")
    parser.add_argument(
        "--truth", type=Path, required=True, metavar="PATH", help="folder that the emulated payload wrote, or TUM file"
    )
    parser.add_argument(
        "--settle", type=float, default=10.0, metavar="S", help="clocks: leave out this much of an epoch"
    )
    parser.add_argument("--over", type=float, default=100.0, metavar="M", help="trajectory: stretches of the RPE")


def run(args: argparse.Namespace) -> int:
    """Print the comparison."""
    if args.what == "trajectory":
        return _trajectory(args)
    reports = clock_reports(args.session, args.truth, args.settle)
    if args.json:
        print(msgspec.json.encode(reports).decode())
    else:
        Console().print(clock_table(reports))
    return exit_codes.GOOD


def _trajectory(args: argparse.Namespace) -> int:
    from edge.process.against_truth import compare

    found = compare(args.session, args.truth, args.over)
    if args.json:
        print(msgspec.json.encode(found).decode())
    else:
        console().print(trajectory_table(found))
    return exit_codes.GOOD


def trajectory_table(found: list[Compared]) -> Table:
    """The comparison for people."""
    first = found[0].errors
    title = f"trajectory: {first.poses:,} poses over {first.length_m:,.1f} m; APE, and RPE over {first.rpe_over_m:g} m"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    # What fits 80 columns; --json has the rest.
    columns = ("rmse m", "worst", "across", "up", "deg", "RPE m", "end m", "drift %", "NEES", "in 95 %")
    for column in ("frame", "aligned", *columns):
        table.add_column(column, justify="left" if column in {"frame", "aligned"} else "right", no_wrap=True)
    for one in found:
        e = one.errors
        metres = (e.ape_m.rmse, e.ape_m.worst, e.ape_horizontal_m.rmse, e.ape_vertical_m.rmse)
        figures = [*(f"{value:.3f}" for value in metres), f"{e.ape_deg.rmse:.2f}", f"{e.rpe_m.rmse:.3f}"]
        figures += [f"{e.end_m:.3f}", f"{e.drift_percent:.2f}"]
        figures += [f"{e.nees:.2f}", f"{e.within_95:.0%}"] if isfinite(e.nees) else ["", ""]
        table.add_row(one.trajectory, e.alignment, *(figure.replace("nan", "-") for figure in figures))
    return table


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
