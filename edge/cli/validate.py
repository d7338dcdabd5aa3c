"""`mapforest validate`: is a recording good."""

from __future__ import annotations

import argparse
from pathlib import Path

import msgspec
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from edge.cli import exit_codes
from edge.cli.words import console
from edge.config import load
from edge.validation.report import Level, Report, TopicReport
from edge.validation.validate import validate
from edge.words import date, duration, size

HELP = """judge a recording: topics, rates, gaps, losses, clocks, GNSS

example: mapforest validate ~/mapforest/recordings/20260612T081500Z_north-slope

Takes a session folder, a rosbag2 folder or .mcap files, of any recorder. Exit code 0: PASS; 3: WARN; 1: FAIL."""
_EXIT = {"PASS": exit_codes.GOOD, "WARN": exit_codes.WARNINGS, "FAIL": exit_codes.FAILED}
_STYLES = {"PASS": "bold green", "WARN": "bold yellow", "FAIL": "bold red"}
_MARKS = {Level.NOTE: ("ok", "green"), Level.WARN: ("warn", "yellow"), Level.FAIL: ("FAIL", "bold red")}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument(
        "recording", type=Path, nargs="+", help="session folder, bag folder, or one or more .mcap files"
    )


def run(args: argparse.Namespace) -> int:
    """Print the report; the verdict decides the exit code."""
    report = validate(args.recording, load(args.config))
    if args.json:
        print(msgspec.json.encode(report).decode())
    else:
        show(report, console())
    return _EXIT[report.verdict]


def show(report: Report, out: Console) -> None:
    """The report for people: the verdict and why, then the figures."""
    style = _STYLES[report.verdict]
    kind = "" if report.own else ", not recorded by mapforest: judged against itself"
    out.print(f"[{style}]{report.verdict}[/] {escape(report.target)}{kind}", highlight=False)
    facts = f"{duration(report.duration_s)}, {size(report.size_bytes)}, {report.messages:,} messages"
    files = "1 file" if len(report.files) == 1 else f"{len(report.files)} files"
    out.print(f"{date(report.start_ns)}, {facts}, {files}", highlight=False)
    for finding in report.findings:
        if finding.level is not Level.NOTE:
            word, colour = _MARKS[finding.level]
            advice = f" [dim]→ {escape(finding.advice)}[/]" if finding.advice else ""
            out.print(f"  [{colour}]{word}[/] {escape(finding.text)}{advice}", highlight=False)
    out.print(_table(report))
    for line in (*_extras(report), *(f.text for f in report.findings if f.level is Level.NOTE)):
        out.print(f"[dim]{escape(line)}[/]", highlight=False)


def _table(report: Report) -> Table:
    table = Table(box=None, padding=(0, 1), header_style="bold")
    for title, side in (("topic", "left"), ("messages", "right"), ("Hz", "right"), ("expected", "right")):
        table.add_column(title, justify="right" if side == "right" else "left", no_wrap=True)
    for title in ("longest gap", "begins after", "ends before end", ""):
        table.add_column(title, justify="right", no_wrap=True)
    for topic in report.topics:
        table.add_row(*_row(topic))
    return table


def _row(topic: TopicReport) -> tuple[str, ...]:
    judged = topic.expected_hz is not None or topic.required
    word, style = _MARKS[topic.level] if judged or topic.level is not Level.NOTE else ("", "dim")
    if topic.count == 0:
        expected = f"{topic.expected_hz:.4g}" if topic.expected_hz else ""
        return escape(topic.name), "0", "", expected, "", "", "", f"[{style}]{word}[/]"
    several = topic.count > 1
    return (
        escape(topic.name),
        f"{topic.count:,}",
        f"{topic.rate_hz:.4g}" if several else "",
        f"{topic.expected_hz:.4g}" if topic.expected_hz else "",
        f"{topic.largest_gap_s:.2f} s at {topic.gap_at_s:.1f} s" if several else "",
        f"{topic.starts_s:.2f} s",
        f"{topic.ends_before_s:.2f} s",
        f"[{style}]{word}[/]",
    )


def _extras(report: Report) -> list[str]:
    said = []
    if report.gnss is not None:
        kinds = ", ".join(f"{name} {count / report.gnss.epochs:.0%}" for name, count in report.gnss.qualities.items())
        said.append(f"GNSS: {kinds} ({report.gnss.epochs:,} epochs, {report.gnss.source})")
    if report.clock_sigma_ms:
        said.append("clocks known to: " + ", ".join(f"{n} {ms:.2f} ms" for n, ms in report.clock_sigma_ms.items()))
    said.append(f"judged in {report.elapsed_s:.1f} s")
    return said
