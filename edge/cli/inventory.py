"""`mapforest inventory`: stems and diameters from a map."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

import msgspec
from rich.markup import escape

from edge.cli import exit_codes
from edge.cli.stage_bar import StageBar
from edge.cli.words import console
from edge.config import load
from edge.errors import EdgeError

HELP = """stems, diameters, heights and crowns from a map

example: mapforest inventory recordings/20261124T101500Z_walk --fine
         mapforest inventory recordings/20261124T101500Z_walk/products/refined --fine
         mapforest inventory plot.laz --marked taped_trees.csv
         mapforest inventory plot.ply --output plot_trees --no-laz
         mapforest inventory plot.laz --field-list plot_17.csv
         mapforest inventory recordings/20261124T101500Z_walk --april-tags --field-list plot_17.csv

Takes a session that was processed, or refined, or a map as LAS, LAZ or PLY in metres. Writes trees.gpkg, trees.csv,
rejected.csv (with the reasons), a page with stem map and slices, trees.laz, and tree_edits.csv: there you confirm, add
and delete trees; it survives, and every run begins with it. Done with warnings when there are no trees."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("map", type=Path, help="session folder, its products, or a .las, .laz or .ply file")
    parser.add_argument("--output", type=Path, metavar="DIR", help="default: products/inventory, or beside the file")
    parser.add_argument(
        "--marked", type=Path, metavar="CSV", help="field list of taped trees (x, y, dbh_cm): fits the device's bias"
    )
    parser.add_argument(
        "--field-list",
        type=Path,
        metavar="CSV",
        help="trees with numbers (tag, dbh_cm, perhaps species; x and y, lon and lat, or azimuth_deg and distance_m): "
        "matched by how they stand among each other",
    )
    parser.add_argument(
        "--april-tags",
        action="store_true",
        help="read AprilTags (36h11) on stems in the session's video as tree numbers",
    )
    parser.add_argument("--device-bias", type=Path, metavar="FILE", help="device_bias.json of an earlier run")
    parser.add_argument("--fine", action="store_true", help="map the session once more at 2 cm: for its diameters")
    parser.add_argument("--no-laz", action="store_true", help="leave out trees.laz")


def run(args: argparse.Namespace) -> int:
    """Measure and say what was found."""
    from edge.inventory.run import Asked, run_inventory
    from pipeline.inventory.errors import InventoryError

    asked = Asked(
        args.map,
        args.output,
        args.marked,
        args.device_bias,
        args.field_list,
        args.april_tags,
        not args.no_laz,
        args.fine,
    )
    logging.getLogger("pyogrio").setLevel(logging.WARNING)  # it counts every record it writes
    out = console(stderr=args.json)
    try:
        with StageBar(quiet=args.json) as bar:
            folder, facts = run_inventory(asked, load(args.config), bar)
    except InventoryError as error:
        raise EdgeError(str(error)) from error
    except OSError as error:
        where = error.filename or asked.output or asked.target
        raise EdgeError(
            f"{where}: {error.strerror or error}; make room, or give another place with --output"
        ) from error
    if args.json:
        print(msgspec.json.encode({"folder": str(folder), **msgspec.to_builtins(facts)}).decode())
        return exit_codes.GOOD if facts.trees else exit_codes.WARNINGS
    out.print(f"[bold]{escape(facts.map)}[/]: {facts.trees} trees, {facts.rejected} rejected, {facts.points:,} points")
    if facts.field_list is not None:
        out.print(f"  {facts.field_list.matched} of {facts.field_list.listed} trees of the field list", highlight=False)
    for note in (facts.why, *facts.notes):
        if note:
            out.print(f"  {escape(note)}", highlight=False)
    for name, meaning in facts.files.items():
        out.print(f"  {escape(str(folder / name))}  [dim]{escape(meaning)}[/]", highlight=False, soft_wrap=True)
    return exit_codes.GOOD if facts.trees else exit_codes.WARNINGS
