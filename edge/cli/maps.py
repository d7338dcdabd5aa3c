"""`mapforest evaluate map`: what a map is worth, without truth, beside another map, and against surveyed points."""

from __future__ import annotations

import argparse
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from rich.console import Console
from rich.table import Table

from edge.cli import exit_codes
from edge.cli.stage_bar import StageBar
from edge.cli.words import console
from edge.errors import EdgeError, UsageError
from pipeline.evaluation.errors import EvaluationError
from pipeline.inventory.errors import InventoryError

if TYPE_CHECKING:  # heavy: scipy, numba
    from pipeline.evaluation.control import ControlErrors
    from pipeline.evaluation.map import MapQuality, Overlap

_MAPS = ("map.laz", "map_local.laz")


def run(args: argparse.Namespace) -> int:
    """Of a file, or of the map among the products of a session."""
    from pipeline.evaluation.control import read_control
    from pipeline.evaluation.map import Asked, map_quality
    from pipeline.inventory.map_file import open_map

    if args.truth is not None or args.dataset is not None:
        raise UsageError("evaluate map: give one map; what is known of the place goes to --reference or --control")
    if not 0.05 <= args.radius <= 2.0:
        raise UsageError(f"--radius {args.radius:g}: between 0.05 and 2 metres")
    if args.gap <= 0.0:
        raise UsageError(f"--gap {args.gap:g}: more than 0 seconds")
    try:
        control = read_control(args.control) if args.control is not None else ()
        source = open_map(_file(args.estimate))
        reference = open_map(_file(args.reference)) if args.reference is not None else None
        with StageBar(quiet=args.json) as bar:
            bar.stage("map", done=False)
            found = map_quality(source, Asked(args.radius, args.gap, control), reference, bar.advance)
    except (EvaluationError, InventoryError) as error:
        raise EdgeError(str(error)) from error
    if args.json:
        print(msgspec.json.encode(found).decode())
    else:
        show(console(), found)
    return exit_codes.GOOD


def _file(target: Path) -> Path:
    """Of a session or its products, or the file itself."""
    folders = (target, target / "products") if target.is_dir() else ()
    return next((folder / name for folder in folders for name in _MAPS if (folder / name).exists()), target)


def show(out: Console, found: MapQuality) -> None:
    """A line a measure."""
    table = Table(title=f"{found.map}: {found.points:,} points", title_justify="left", box=None, show_header=False)
    table.add_column("what")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("meaning", style="dim")
    sharp, bark = found.sharpness, found.bark
    around = f"in {sharp.radius_m:g} m around {sharp.places:,} points"
    table.add_row("map entropy", _figure(sharp.entropy, 1.0, ""), f"mean, {around}; lower is sharper")
    table.add_row("plane thickness", _figure(sharp.plane_m), "mean upper quartile of the distances to the local plane")
    table.add_row("  of surfaces", _figure(sharp.surface_m), f"{sharp.surfaces:.0%} of the points lie on some")
    table.add_row("bark", _figure(bark.thickness_m), f"robust sigma about {bark.stems} stems, median")
    table.add_row("  worst tenth", _figure(bark.thickness_90_m), "and more")
    _rows(table, "passes apart", found.overlap, "the later pass less the earlier")
    if found.reference is not None:
        _rows(table, "to reference", found.reference, "map less reference")
    if found.control is not None:
        control = found.control
        seen = sum(one.up_m is not None for one in control.points)
        aside = sum(one.east_m is not None for one in control.points)
        table.add_row("control, up", _figure(control.up_rmse_m), f"rms of {seen} of {len(control.points)} points")
        table.add_row("  bias", _figure(control.up_bias_m), "map less survey")
        told = f"rms of {aside} points with a target that reflects" if aside else "no target that reflects was seen"
        table.add_row("  in plan", _figure(control.horizontal_rmse_m), told)
    out.print(table)
    if found.control is not None:
        out.print(_control(found.control))


def _rows(table: Table, name: str, found: Overlap, order: str) -> None:
    if found.why:
        table.add_row(name, "-", found.why)
        return
    table.add_row(name, _figure(found.median_m), f"median at {found.places:,} places on surfaces")
    table.add_row("  95 %", _figure(found.p95_m), "are less apart")
    table.add_row("  up", _figure(found.up_m), f"median of level surfaces, {order}")


def _control(found: ControlErrors) -> Table:
    table = Table(box=None, padding=(0, 1, 0, 0))
    for column in ("point", "up m", "x m", "y m", "ground points"):
        table.add_column(column, justify="left" if column == "point" else "right")
    for one in found.points:
        figures = [f"{value:+.3f}" if value is not None else "-" for value in (one.up_m, one.east_m, one.north_m)]
        table.add_row(one.name, *figures, str(one.points))
    return table


def _figure(value: float, factor: float = 1000.0, unit: str = " mm") -> str:
    if not isfinite(value):
        return "-"
    return f"{factor * value:.1f}{unit}" if unit else f"{factor * value:.3f}"
