"""`mapforest evaluate alignment`: what `align` found, against the truth."""

from __future__ import annotations

import argparse
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.table import Table

from edge.cli import exit_codes
from edge.cli.words import console
from edge.errors import EdgeError, UsageError
from pipeline.alignment.errors import AlignmentError

if TYPE_CHECKING:  # heavy: scipy
    from pipeline.alignment.transform import Transform
    from pipeline.evaluation.alignment import AlignmentErrors, AlignmentSummary


def run(args: argparse.Namespace) -> int:
    """Print the errors of one alignment, or of every one below a folder."""
    from pipeline.alignment.result import FILE, read_result
    from pipeline.evaluation.alignment import alignment_errors, summary

    if args.truth is None:
        raise UsageError("evaluate alignment: give the truth with --truth: an alignment.json, or a text of X,Y,Z,YAW")
    folder: Path = args.estimate
    files = sorted(folder.rglob(FILE)) if folder.is_dir() else [folder]
    if not files:
        raise EdgeError(f"{folder}: holds no {FILE}; give what `mapforest align` wrote, or a folder of many")
    try:
        results = {str(file): read_result(file) for file in files}
        true = _truth(args.truth)
    except AlignmentError as error:
        raise EdgeError(str(error)) from error
    errors = {name: alignment_errors(found, true) for name, found in results.items()}
    whole = summary(list(errors.values()))
    if args.json:
        print(msgspec.json.encode({"alignments": errors, "summary": whole}).decode())
    else:
        console().print(_table(errors, whole))
    return exit_codes.GOOD


def _truth(path: Path) -> Transform:
    """Of an alignment.json; or a text file of four numbers: a turn about the origin, then a shift."""
    from pipeline.alignment.result import read_result
    from pipeline.alignment.transform import Transform

    if path.suffix.lower() == ".json":
        return read_result(path).transform
    try:
        x, y, z, yaw = (float(word) for word in path.read_text(encoding="utf-8").replace(",", " ").split())
    except OSError as error:
        raise EdgeError(f"{path}: cannot be read ({error.strerror}); give the truth with --truth") from error
    except ValueError:
        raise EdgeError(f"{path}: four numbers are expected, X Y Z in metres and YAW in degrees") from None
    return Transform((0.0, 0.0), x, y, z, yaw)


def _table(errors: dict[str, AlignmentErrors], whole: AlignmentSummary) -> Table:
    from pipeline.evaluation.alignment import NEAR_DEG, NEAR_M

    title = (
        f"alignment: {whole.near} of {whole.count} within {NEAR_M:g} m and {NEAR_DEG:g}°; "
        f"{whole.right} said so, {whole.refused} refused, {whole.wrong} wrong"
    )
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0))
    for column in ("", "m", "up m", "deg", "normalised", "verdict"):
        table.add_column(column, justify="left" if column in {"", "verdict"} else "right")
    for name, one in errors.items():
        up = f"{one.up_m:+.2f}" if isfinite(one.up_m) else "-"
        table.add_row(name, f"{one.horizontal_m:.2f}", up, f"{one.turn_deg:+.2f}", f"{one.normalised:.1f}", one.said)
    if len(errors) > 1:
        up = f"{whole.median_up_m:.2f}" if isfinite(whole.median_up_m) else "-"
        table.add_row("median", f"{whole.median_m:.2f}", up, f"{whole.median_deg:.2f}", f"{whole.normalised:.1f}", "")
    return table
