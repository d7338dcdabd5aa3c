"""`mapforest refine`: the workstation's trajectory and map."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Mapping
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
         mapforest refine recordings/20261124T101500Z_walk --constraints corrections.toml
         mapforest refine recordings/*_oakhill --out oakhill

Sessions are processed first where they are not. What comes out of one lies in `products/refined/`: the products again,
and refinement.html, which shows the graph and offers lines for constraints.toml beside it. Several sessions of one site
are refined together: a folder with one map of all, and the products of each. Those that do not meet are refined alone,
which is said. What is done is not done again. It needs the extra `refine` and Python 3.11 or later."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument(
        "session", type=Path, nargs="+", help="folders of sessions, or .mcap files: of one site, together"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="of several sessions (default: beside the first one)")
    parser.add_argument("--constraints", type=Path, metavar="FILE", help="the analyst's corrections")
    parser.add_argument(
        "--detect", metavar="MODEL", help='detector, "" for none (default: detection.model, or that of `process`)'
    )


def run(args: argparse.Namespace) -> int:
    """Warnings where a session could not be put on the Earth."""
    from edge.process.looked_with import looked_with
    from edge.process.process import Task
    from edge.process.refine import refine
    from edge.process.together import refine_together

    logging.getLogger("pyogrio").setLevel(logging.WARNING)  # it counts every record it writes
    tasks = [Task([session]) for session in args.session]
    config = looked_with(load(args.config), args.detect, [task.folder for task in tasks])
    if args.out is not None and len(tasks) == 1:
        raise UsageError("--out: it is for several sessions; one has its refinement among its products")
    with StageBar(quiet=args.json) as bar:
        if len(tasks) == 1:
            one = refine(tasks[0], config, args.constraints, bar)
            done, graphs = [one], [one.folder]
        else:
            found = refine_together(tasks, config, args.out, args.constraints, watch=bar)
            done, graphs = list(found.sessions), [found.folder / group.folder for group in found.groups]
    if args.json:
        told = [{"folder": str(one.folder), "redone": one.redone, **msgspec.to_builtins(one.facts)} for one in done]
        print(msgspec.json.encode(told).decode())
    else:
        if not any(one.redone for one in done):
            console().print("nothing had changed since the last run")
        for folder in graphs:
            _tell_graph(folder)
        for one in done:
            _tell(one)
    return exit_codes.WARNINGS if any(each.facts.datum is None for each in done) else exit_codes.GOOD


def _tell_graph(folder: Path) -> None:
    from edge.process.refinement_stage import CLOSURES, PAGE, REFINEMENT, RefinementFacts
    from edge.process.together import MAP

    out, found = console(), msgspec.json.decode((folder / REFINEMENT).read_bytes(), type=RefinementFacts)
    several = len(found.sessions) > 1
    out.print(
        f"[bold]{escape(', '.join(found.sessions))}[/]: {found.keyframes} keyframes, {found.fixes_used} of "
        f"{found.fixes} fixes used, {found.closures} of {found.candidates} closures believed"
        + (f", {found.between_sessions} of them between sessions" if several else ""),
        highlight=False,
    )
    for note in found.notes:
        out.print(f"  {escape(note)}", highlight=False)
    shown = {PAGE: "the graph: what was believed, and lines to correct it", CLOSURES: "every candidate, and why"}
    if several:
        shown[MAP] = "points of all sessions; the point source ID is the number of the session"
    _tell_files(folder, {name: meaning for name, meaning in shown.items() if (folder / name).exists()})


def _tell(done: Refined) -> None:
    out, facts = console(), done.facts
    out.print(f"[bold]{escape(facts.session)}[/]: sigma at the end {facts.sigma_end_m:.2f} m", highlight=False)
    for note in facts.notes:
        out.print(f"  {escape(note)}", highlight=False)
    _tell_files(done.folder, facts.files)


def _tell_files(folder: Path, files: Mapping[str, str]) -> None:
    for name, meaning in files.items():
        console().print(f"  {escape(str(folder / name))}  [dim]{escape(meaning)}[/]", highlight=False)
