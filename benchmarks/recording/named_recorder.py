"""`mapforest recorder` at its priority, with the names of its threads told to the kernel to tell their CPU apart."""

from __future__ import annotations

import ctypes
import sys
import threading

from benchmarks.recording.priority import claim
from edge.cli.main import main

PR_SET_NAME = 15
NICE = -5
"""As in the recorder's systemd unit, where this user may ask for it."""


def _name_threads() -> None:
    libc = ctypes.CDLL(None)
    run = threading.Thread.run

    def named(thread: threading.Thread) -> None:
        libc.prctl(PR_SET_NAME, thread.name[:15].encode(), 0, 0, 0)
        run(thread)

    threading.Thread.run = named  # type: ignore[method-assign]


if __name__ == "__main__":
    _name_threads()
    claim(NICE)
    sys.exit(main(["recorder", *sys.argv[1:]]))
