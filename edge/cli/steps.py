"""Commands that are made of steps: `mapforest dataset frames`, `mapforest calibrate time`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

import msgspec
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from edge.cli.words import console

Step = tuple[str, Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], int]]
"""What it does in a line, its options, and how it is done."""
_NAMED = 3


class Steps(Protocol):
    """A module of steps."""

    STEPS: dict[str, Step]


def add_steps(parser: argparse.ArgumentParser, modules: Sequence[Steps]) -> None:
    """A parser for each step, which leaves its function in `args.step`; common options may stand before or after it."""
    steps = parser.add_subparsers(title="steps", metavar="WHAT", dest="what", required=True)
    for module in modules:
        for name, (summary, add, run) in module.STEPS.items():
            step = steps.add_parser(
                name, help=summary, description=summary, formatter_class=argparse.RawDescriptionHelpFormatter
            )
            _add_common(step)
            add(step)
            step.set_defaults(step=run)


def _add_common(step: argparse.ArgumentParser) -> None:
    """The options of every command once more, without a default that would undo what stood before the step."""
    told = argparse.SUPPRESS
    step.add_argument("--config", type=Path, default=told, metavar="FILE", help="TOML configuration")
    step.add_argument("--json", action="store_true", default=told, help="print JSON for programs")
    step.add_argument("--verbose", "-v", action="store_true", default=told, help="say more on standard error")


def tell(args: argparse.Namespace, report: object, lines: Sequence[str]) -> None:
    """The report as JSON for programs, or lines for people; empty ones are left out."""
    if args.json:
        print(msgspec.json.encode(report).decode())
        return
    out = console()
    for line in lines:
        if line:
            out.print(escape(line), highlight=False)


def some(count: int, what: str) -> str:
    """A line about so many; nothing about none."""
    return f"  {what}: {count:,}" if count else ""


def named(names: Sequence[str], what: str) -> str:
    """The same with the first few names."""
    shown = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
    return f"  {what}: {len(names):,} ({shown})" if names else ""


def table(columns: Sequence[str]) -> Table:
    """The first column to the left, figures to the right."""
    made = Table(box=None, padding=(0, 1), header_style="bold")
    for number, column in enumerate(columns):
        made.add_column(column, justify="right" if number else "left", no_wrap=True)
    return made


def out() -> Console:
    """For tables."""
    return console()
