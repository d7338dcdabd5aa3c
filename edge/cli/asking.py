"""What the clients of the recorder on the command line have in common."""

from __future__ import annotations

import argparse
import sys

import msgspec

from edge.config import load
from edge.control.client import ControlClient
from edge.control.messages import Reply, Request
from edge.paths import find_control_socket

FINISHING_S = 90.0
"""A stop waits for the queue to reach a slow card."""


def connect(args: argparse.Namespace, timeout_s: float = 10.0) -> ControlClient:
    """A client of the recorder the configuration names."""
    return ControlClient(find_control_socket(load(args.config)), timeout_s)


def ask(args: argparse.Namespace, request: Request, timeout_s: float = 10.0) -> Reply:
    """One request, one reply. ControlError when refused."""
    with connect(args, timeout_s) as client:
        return client.request(request)


def print_reply(args: argparse.Namespace, reply: Reply, text: str) -> None:
    """The reply as JSON for programs, or `text` for people."""
    if args.json:
        sys.stdout.write(msgspec.json.encode(reply).decode() + "\n")
    else:
        print(text)
