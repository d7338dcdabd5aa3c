"""`mapforest evaluate`: estimates against ground truth."""

from __future__ import annotations

import argparse
from pathlib import Path

import msgspec
from rich.console import Console
from rich.table import Table

from edge.cli import exit_codes
from edge.validation.clock_truth import ClockReport, clock_reports

HELP = """compare estimates with ground truth

example: mapforest evaluate clocks demo/recordings/20261124T101500Z_demo --truth demo/truth

clocks: offset and drift of each sensor's clock, estimated while recording, against the emulated payload's truth."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("what", choices=["clocks"], help="what to evaluate")
    parser.add_argument("session", type=Path, help="session folder")
    parser.add_argument("--truth", type=Path, required=True, metavar="FOLDER", help="what the emulated payload wrote")
    parser.add_argument("--settle", type=float, default=10.0, metavar="S", help="leave out the start of each epoch")


def run(args: argparse.Namespace) -> int:
    """Print the comparison."""
    reports = clock_reports(args.session, args.truth, args.settle)
    if args.json:
        print(msgspec.json.encode(reports).decode())
    else:
        Console().print(clock_table(reports))
    return exit_codes.GOOD


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
