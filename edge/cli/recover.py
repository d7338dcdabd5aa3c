"""`mapforest recover`: a sound copy of a damaged recording."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
from rich.markup import escape
from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn

from edge.cli import exit_codes
from edge.cli.words import console
from edge.recording import recover as recovery
from edge.recording.recover import RecoverReport, recover
from edge.recording.recover_folder import recover_folder
from edge.validation.files import recording_files

HELP = """copy everything sound out of a damaged recording

example: mapforest recover walk_3.mcap.active --output walk_3.mcap

Never writes over its input. Exit code 0: nothing was lost; 3: something was, which is said; 1: nothing to save."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("recording", type=Path, help="a damaged file, or the session folder it is in")
    parser.add_argument("--output", "-o", type=Path, metavar="PATH", help="new file or folder (default: *_recovered)")


def run(args: argparse.Namespace) -> int:
    """Recover, and say what was lost."""
    target = args.output or default_target(args.recording)
    with _progress(quiet=args.json) as progress:
        if args.recording.is_dir():
            reports, failed = recover_folder(recording_files([args.recording]), args.recording, target, progress)
        else:
            reports, failed = [recover(args.recording, target, progress)], {}
    if args.json:
        print(msgspec.json.encode(_told(target, reports, failed)).decode())
    else:
        _show(target, reports, failed)
    lossless = not failed and all(report.lossless for report in reports)
    return exit_codes.GOOD if lossless else exit_codes.WARNINGS


def default_target(source: Path) -> Path:
    """Beside the source: walk_3.mcap.active -> walk_3_recovered.mcap, walk/ -> walk_recovered/."""
    if source.is_dir():
        return source.resolve().with_name(f"{source.resolve().name}_recovered")
    name = source.name.removesuffix(".active").removesuffix(".mcap")
    return source.with_name(f"{name}_recovered.mcap")


@contextmanager
def _progress(*, quiet: bool) -> Iterator[recovery.Progress | None]:
    if quiet or not sys.stderr.isatty():
        yield None
        return
    columns = (TextColumn("recovering"), BarColumn(), DownloadColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _told(target: Path, reports: list[RecoverReport], failed: dict[str, str]) -> dict[str, Any]:
    files = [
        msgspec.to_builtins(report)
        | {"messages": report.messages, "lossless": report.lossless, "words": report.words()}
        for report in reports
    ]
    lossless = not failed and all(report.lossless for report in reports)
    return {"target": str(target), "lossless": lossless, "files": files, "failed": failed}


def _show(target: Path, reports: list[RecoverReport], failed: dict[str, str]) -> None:
    out = console()
    for report in reports:
        style = "green" if report.lossless else "yellow"
        first, *more = report.words()
        out.print(f"[bold]{escape(Path(report.source).name)}[/] [{style}]{escape(first)}[/]", highlight=False)
        for line in more:
            out.print(f"  {escape(line)}", highlight=False)
        for topic, count in report.topics.items():
            out.print(f"  [dim]{count:>12,}  {escape(topic)}[/]", highlight=False)
    for name, why in failed.items():
        out.print(f"[bold]{escape(name)}[/] [red]{escape(why)}[/]", highlight=False)
    out.print(f"Written: {escape(str(target))}", highlight=False)
