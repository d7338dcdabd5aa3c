"""`mapforest refine`: the workstation's trajectory and map."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
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


def run(args: argparse.Namespace) -> int:
    """Warnings where a session could not be put on the Earth."""
    from edge.process.process import Task
    from edge.process.refine import refine
    from edge.process.together import refine_together

    logging.getLogger("pyogrio").setLevel(logging.WARNING)  # it counts every record it writes
    config, tasks = load(args.config), [Task([session]) for session in args.session]
    with StageBar(quiet=args.json) as bar:
        if len(tasks) > 1:
            found = refine_together(tasks, config, args.out, args.constraints, watch=bar)
            done, folders, redone = (
                found.sessions,
                [found.folder / group.folder for group in found.groups],
                found.redone,
            )
        elif args.out is not None:
            raise UsageError("--out: it is for several sessions; one has its refinement among its products")
        else:
            one = refine(tasks[0], config, args.constraints, bar)
            done, folders, redone = (one,), [one.folder], one.redone
    if args.json:
        told = [{"folder": str(each.folder), **msgspec.to_builtins(each.facts)} for each in done]
        graphs = [str(folder) for folder in folders]
        print(msgspec.json.encode({"sessions": told, "graphs": graphs, "redone": redone}).decode())
    else:
        _tell(done, folders, redone)
    return exit_codes.WARNINGS if any(each.facts.frame == "odom" for each in done) else exit_codes.GOOD


def _tell(done: Sequence[Refined], folders: Sequence[Path], redone: Sequence[str]) -> None:
    from edge.process.refinement_stage import CLOSURES, PAGE, REFINEMENT, RefinementFacts
    from edge.process.together import MAP

    out = console()
    if not redone:
        out.print("nothing had changed since the last run")
    for folder in folders:
        found = msgspec.json.decode((folder / REFINEMENT).read_bytes(), type=RefinementFacts)
        out.print(
            f"[bold]{escape(', '.join(found.sessions))}[/]: {found.keyframes} keyframes, {found.fixes_used} of "
            f"{found.fixes} fixes used, {found.closures} of {found.candidates} closures believed"
            + (f", {found.between_sessions} of them between sessions" if len(found.sessions) > 1 else ""),
            highlight=False,
        )
        for note in found.notes:
            out.print(f"  {escape(note)}", highlight=False)
        shown = {PAGE: "the graph: what was believed, and lines to correct it", CLOSURES: "every candidate, and why"}
        if len(found.sessions) > 1:
            shown[MAP] = "points of all sessions; the point source ID is the number of the session"
        for name, meaning in shown.items():
            if (folder / name).exists():
                out.print(f"  {escape(str(folder / name))}  [dim]{escape(meaning)}[/]", highlight=False)
    for each in done:
        facts = each.facts
        sigma = f"sigma at the end {facts.sigma_end_m:.2f} m"
        out.print(f"[bold]{escape(facts.session)}[/]: {len(facts.files)} products, {sigma}", highlight=False)
        for note in facts.notes:
            out.print(f"  {escape(note)}", highlight=False)
        for name, meaning in facts.files.items():
            out.print(f"  {escape(str(each.folder / name))}  [dim]{escape(meaning)}[/]", highlight=False)
