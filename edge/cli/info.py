"""`mapforest info`: what is in a recording."""

from __future__ import annotations

import argparse
from pathlib import Path

import msgspec
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from edge.cli import exit_codes
from edge.cli.words import console
from edge.validation.info import Info, TopicInfo, info
from edge.words import date, duration, size

HELP = """list topics, types, counts and rates of a recording

example: mapforest info walk_0.mcap

Takes a session folder, a rosbag2 folder or .mcap files, also of other recorders."""
_SHOWN = ("session", "mission", "operator", "carrier", "software", "host", "clock_source")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument(
        "recording", type=Path, nargs="+", help="session folder, bag folder, or one or more .mcap files"
    )


def run(args: argparse.Namespace) -> int:
    """Print what is there; warnings when a file was not closed or is damaged."""
    found = info(args.recording)
    if args.json:
        print(msgspec.json.encode(found).decode())
    else:
        show(found, console())
    sound = not found.unreadable and all(file.finished and not file.problems for file in found.files)
    return exit_codes.GOOD if sound else exit_codes.WARNINGS


def show(found: Info, out: Console) -> None:
    """For people."""
    out.print(f"[bold]{escape(found.target)}[/]", highlight=False)
    if found.messages:
        out.print(f"{date(found.start_ns)} to {date(found.end_ns)}, {duration(found.duration_s)}", highlight=False)
    out.print(f"{size(found.size_bytes)}, {found.messages:,} messages on {len(found.topics)} topics", highlight=False)
    known = [f"{key.replace('_', ' ')} {found.session[key]}" for key in _SHOWN if found.session.get(key)]
    if found.session:
        ended = [f"ended: {found.ended}"] if found.ended else []
        out.print(escape(", ".join([*known, *ended, f"{found.marks} marks"])), highlight=False)
    out.print(_files(found))
    for name, why in found.unreadable.items():
        out.print(f"[red]{escape(name)}: {escape(why)}[/]", highlight=False)
    out.print(_topics(found))


def _files(found: Info) -> Table:
    table = Table(box=None, padding=(0, 1), header_style="bold")
    for title in ("file", "size", "messages", "chunks", "compression", "profile", "written by", ""):
        table.add_column(title, justify="right" if title in {"size", "messages", "chunks"} else "left")
    for file in found.files:
        state = "; ".join((() if file.finished else ("not closed",)) + file.problems)
        counts = (size(file.size_bytes), f"{file.messages:,}", f"{file.chunks:,}")
        names = (file.compression, escape(file.profile), escape(file.library))
        table.add_row(escape(file.name), *counts, *names, f"[yellow]{escape(state)}[/]")
    return table


def _topics(found: Info) -> Table:
    table = Table(box=None, padding=(0, 1), header_style="bold")
    for title in ("topic", "type", "messages", "Hz", "slowest..fastest"):
        table.add_column(title, justify="left" if title in {"topic", "type"} else "right", no_wrap=title != "type")
    for topic in found.topics:
        table.add_row(*_row(topic))
    return table


def _row(topic: TopicInfo) -> tuple[str, ...]:
    several = topic.count > 1
    return (
        escape(topic.name),
        escape(topic.type_name),
        f"{topic.count:,}",
        f"{topic.rate_hz:.4g}" if several else "",
        f"{topic.slowest_hz:.4g}..{topic.fastest_hz:.4g}" if several and topic.fastest_hz else "",
    )
