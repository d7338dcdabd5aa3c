"""`mapforest start`."""

from __future__ import annotations

import argparse

from edge.cli import exit_codes
from edge.cli.asking import ask, print_reply
from edge.control.messages import Request

HELP = """start recording

example: mapforest start --mission "plot 7" --operator ada
Starting while a recording runs changes nothing and names that recording."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What the session is about."""
    parser.add_argument("--mission", default="", help="name of the mission, part of the session's name")
    parser.add_argument("--operator", default="", help="who records")
    parser.add_argument("--carrier", default="", help="handheld, backpack, bicycle, uav, ...")


def run(args: argparse.Namespace) -> int:
    """ControlError when the recorder cannot be reached or cannot record."""
    reply = ask(args, Request("start", mission=args.mission, operator=args.operator, carrier=args.carrier))
    print_reply(args, reply, f"recording {reply.session}\n{reply.folder}")
    return exit_codes.GOOD
