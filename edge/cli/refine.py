"""`mapforest refine`: the workstation's trajectory and map."""

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

if TYPE_CHECKING:
    from edge.process.refine import Refined

HELP = """the best trajectory and map that a session can give: a factor graph over odometry, GNSS and closed loops

example: mapforest refine recordings/20261124T101500Z_walk
         mapforest refine recordings/*_walk --json
         mapforest refine recordings/20261124T101500Z_walk --constraints corrections.toml

Sessions are processed first where they are not. What comes out lies in `products/refined/`: the products again, and
refinement.html, which shows the graph and offers lines for products/refined/constraints.toml. What is done is not done
again. It needs the extra `refine` and Python 3.11 or later."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("session", type=Path, nargs="+", help="folders of sessions, or .mcap files: each by itself")
    parser.add_argument("--constraints", type=Path, metavar="FILE", help="the analyst's corrections, for one session")


def run(args: argparse.Namespace) -> int:
    """Warnings where a session could not be put on the Earth."""
    from edge.process.process import Task
    from edge.process.refine import refine

    if args.constraints is not None and len(args.session) > 1:
        raise UsageError("--constraints: they belong to one session; name that one alone")
    logging.getLogger("pyogrio").setLevel(logging.WARNING)  # it counts every record it writes
    config, code, told = load(args.config), exit_codes.GOOD, []
    for session in args.session:
        with StageBar(quiet=args.json) as bar:
            done = refine(Task([session]), config, args.constraints, bar)
        code = exit_codes.WARNINGS if done.facts.frame == "odom" else code
        if args.json:
            told.append({"folder": str(done.folder), "redone": done.redone, **msgspec.to_builtins(done.facts)})
        else:
            _tell(done)
    if args.json:
        print(msgspec.json.encode(told).decode())
    return code


def _tell(done: Refined) -> None:
    from edge.process.refinement_stage import CLOSURES, PAGE, REFINEMENT, RefinementFacts

    out, facts = console(), done.facts
    found = msgspec.json.decode((done.folder / REFINEMENT).read_bytes(), type=RefinementFacts)
    unchanged = "" if done.redone else "; nothing had changed since the last run"
    out.print(
        f"[bold]{escape(facts.session)}[/]: {found.keyframes} keyframes, {found.fixes_used} of {found.fixes} fixes "
        f"used, {found.closures} of {found.candidates} closures believed, sigma at the end {facts.sigma_end_m:.2f} m"
        f"{unchanged}",
        highlight=False,
    )
    for note in (*found.notes, *facts.notes):
        out.print(f"  {escape(note)}", highlight=False)
    shown = {PAGE: "the graph: what was believed, and lines to correct it", CLOSURES: "every candidate, and why"}
    for name, meaning in (shown | facts.files).items():
        out.print(f"  {escape(str(done.folder / name))}  [dim]{escape(meaning)}[/]", highlight=False)
