"""`mapforest recorder`: the service in the foreground."""

from __future__ import annotations

import argparse
import signal
import threading
from types import FrameType

from edge.cli import exit_codes
from edge.config import load
from edge.service.service import Service

HELP = """run the recorder service: sensors, recording, control socket

example: mapforest recorder --config /etc/mapforest/mapforest.toml
It records when asked to (`mapforest start`, `mapforest tui`), and ends cleanly on Ctrl-C or SIGTERM."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """None beside the common ones."""


def run(args: argparse.Namespace) -> int:
    """Serve until SIGTERM or SIGINT; a session being recorded is finished first."""
    service = Service(load(args.config))
    stop = threading.Event()

    def ask_to_stop(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, ask_to_stop)
    service.run(stop)
    return exit_codes.GOOD
