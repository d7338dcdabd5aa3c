"""`mapforest pipeline`: the live pipeline in the foreground."""

from __future__ import annotations

import argparse
import os
import signal
import threading
from types import FrameType

from edge.cli import exit_codes
from edge.config import load
from edge.errors import UsageError
from edge.paths import find_control_socket

HELP = """run the live pipeline: where the payload is and what the camera sees, back into the recording

example: mapforest pipeline --config /etc/mapforest/mapforest.toml
It needs a recorder (`mapforest recorder`) and waits for one. Its state is in `mapforest status` and on the screen."""
_NICENESS = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--nice", type=int, default=_NICENESS, metavar="N", help="lower priority than the recorder's")


def run(args: argparse.Namespace) -> int:
    """Serve until SIGTERM or SIGINT."""
    config = load(args.config)
    if not config.bus.enabled:
        raise UsageError("bus.enabled is false in the configuration: the recorder sends nothing; set it to true")
    os.nice(args.nice)
    # One thread each: the recorder and the camera need the other cores.
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
    from edge.live.pipeline import serve

    stop = threading.Event()

    def ask_to_stop(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, ask_to_stop)
    serve(config, find_control_socket(config).parent, stop)
    return exit_codes.GOOD
