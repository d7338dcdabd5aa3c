"""`mapforest mark`."""

from __future__ import annotations

import argparse

from edge.cli import exit_codes
from edge.cli.asking import ask, print_reply
from edge.control.messages import Request

HELP = """write a note into the recording, at this instant

example: mapforest mark "ailanthus left of the trail" """


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The note."""
    parser.add_argument("text", nargs="*", help="what is here")


def run(args: argparse.Namespace) -> int:
    """ControlError when nothing is being recorded."""
    text = " ".join(args.text)
    reply = ask(args, Request("mark", text=text))
    print_reply(args, reply, f"marked in {reply.session}: {text or 'mark'}")
    return exit_codes.GOOD
