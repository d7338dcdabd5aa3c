"""`mapforest tui`: the operator's screen."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable
from pathlib import Path

from edge.cli import exit_codes
from edge.config import load
from edge.errors import UsageError
from edge.paths import find_control_socket

HELP = """watch the recorder; start, mark and stop with one key each.

example: mapforest tui --sun --bell"""

APP = "ui.command:run"
"""An import string, as in the command table: `ui` is the floor above, and only this command pays for textual."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--socket", type=Path, metavar="PATH", help="the recorder's control socket, if not the usual one"
    )
    parser.add_argument("--sun", action="store_true", help="black on white, against glare (key C)")
    parser.add_argument("--bell", action="store_true", help="ring the terminal's bell on a new fault or tree (key B)")
    parser.add_argument("--ascii", action="store_true", help="plain characters, for terminals without the symbols")


def has_terminal() -> bool:
    """Whether there is a keyboard to read and a screen to draw on."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def run(args: argparse.Namespace) -> int:
    """Show the screen until the operator leaves it. A recording goes on."""
    if args.json or not has_terminal():
        raise UsageError("the screen needs a terminal; for programs there is `mapforest status --json`")
    socket_path: Path = args.socket or find_control_socket(load(args.config))
    module, _, name = APP.partition(":")
    show: Callable[..., str] = getattr(importlib.import_module(module), name)
    last_word = show(socket_path, sun=args.sun, bell=args.bell, ascii_only=args.ascii)
    if last_word:
        print(last_word)
    return exit_codes.GOOD
