"""Measured diameters beside taped ones, for people and as a page."""

from __future__ import annotations

import argparse
from math import isfinite
from pathlib import Path

import msgspec
import numpy as np
from rich.console import Console
from rich.table import Table

from edge.cli import exit_codes
from edge.cli.words import console
from edge.errors import EdgeError
from edge.inventory.against_truth import read_diameters
from pipeline.evaluation.diameters import DiameterErrors, Diameters, diameter_errors, paired
from pipeline.products import sheet
from pipeline.products.plots import Dots, Line, Plot


def run(args: argparse.Namespace) -> int:
    """Of a session, or of a folder or table of `mapforest inventory`, against a field list or a simulation's truth."""
    given = read_diameters(args.estimate, args.truth)
    found = diameter_errors(given, args.least / 100.0)
    if args.page is not None:
        write_page(args.page, args.estimate, given, found)
    if args.json:
        shares = {"completeness": found.completeness, "commission": found.commission}
        print(msgspec.json.encode({**msgspec.to_builtins(found), **shares}).decode())
    else:
        show(console(), found)
    return exit_codes.GOOD


def show(out: Console, found: DiameterErrors) -> None:
    """One row."""
    table = Table(title=f"diameters: {found.pairs} pairs", title_justify="left", box=None, padding=(0, 1, 0, 0))
    for column in ("found", "complete", "made up", "MRE", "RMSE cm", "bias cm", "median cm", "worst cm", "in 95%"):
        table.add_column(column, justify="right", no_wrap=True)
    metres = (found.rmse_m, found.bias_m, found.median_m, found.worst_m)
    table.add_row(
        f"{found.found} of {found.true}",
        _share(found.completeness),
        f"{found.made_up} of {found.measured}",
        f"{found.mre:.3f}",
        *(f"{100 * value:.2f}" for value in metres),
        _share(found.within_95),
    )
    out.print(table)


def write_page(path: Path, estimate: Path, given: Diameters, found: DiameterErrors) -> None:
    """Scatter plot, and errors over diameter."""
    rows, columns = paired(given)
    true, said = 100 * given.true_dbh_m[columns], 100 * given.dbh_m[rows]
    ends = np.array([0.0, max([1.0, *true, *said])])
    scatter = Plot(
        "taped cm", "measured cm", [Line(ends, ends, "equal", "s")], [Dots(true, said, "stems", "a")], equal=True
    )
    errors = Plot("taped cm", "error cm", dots=[Dots(true, said - true, "measured less taped", "b")])
    shown = {
        "Completeness": f"{found.found} of {found.true}",
        "Made up": f"{found.made_up} of {found.measured}",
        "MRE": f"{found.mre:.3f}",
        "RMSE": f"{100 * found.rmse_m:.2f} cm",
        "Bias": f"{100 * found.bias_m:+.2f} cm",
    }
    parts = [sheet.facts(shown), sheet.figure("Diameters", scatter), sheet.figure("Errors", errors)]
    try:
        path.write_text(sheet.sheet(f"Diameters of {estimate.absolute().name}", parts), encoding="utf-8")
    except OSError as error:
        raise EdgeError(f"{path}: cannot be written ({error.strerror}); give another place with --page") from error


def _share(value: float) -> str:
    return f"{value:.0%}" if isfinite(value) else "-"
