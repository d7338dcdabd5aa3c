"""`mapforest stop`."""

from __future__ import annotations

import argparse

from edge.cli import exit_codes
from edge.cli.asking import FINISHING_S, ask, print_reply
from edge.control.messages import Request

HELP = """stop recording and finish the session on the card

example: mapforest stop
Stopping when nothing is recorded changes nothing. The verdict on the recording comes with `mapforest status`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which session."""
    parser.add_argument("--session", default="", help="only if this is the session being recorded")


def run(args: argparse.Namespace) -> int:
    """ControlError when the recorder cannot be reached, or records another session."""
    reply = ask(args, Request("stop", session=args.session), FINISHING_S)
    print_reply(args, reply, f"stopped {reply.session}\n{reply.folder}" if reply.session else "nothing was recorded")
    return exit_codes.GOOD
