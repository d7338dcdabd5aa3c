"""`mapforest report`: one page a session."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from edge.cli import exit_codes
from edge.cli.words import console
from edge.config import load

HELP = """one HTML page about a session: verdict, map, trees, sensors, and what to do about each warning

example: mapforest report recordings/20261124T101500Z_walk
         mapforest report walk.mcap --products walk_products --output walk.html

It opens without a network, on a phone too. What is not there (no products yet, no GNSS, no detector) is said."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("recording", type=Path, nargs="+", help="session folder, bag folder, or .mcap files in order")
    parser.add_argument("--products", type=Path, metavar="DIR", help="where `process` put them (default: beside it)")
    parser.add_argument("--output", type=Path, metavar="FILE", help="default: report.html beside the products")


def run(args: argparse.Namespace) -> int:
    """Write the page and say where it is."""
    from edge.process.process import Task
    from edge.report.report import write_report

    with console(stderr=True).status("reading the recording, drawing the map: a minute for a walk of a kilometre"):
        path = write_report(Task(args.recording, args.products), load(args.config), args.output)
    if args.json:
        print(json.dumps({"report": str(path), "size_bytes": path.stat().st_size}))
    else:
        console().print(str(path), highlight=False, soft_wrap=True)
    return exit_codes.GOOD
