"""`mapforest recorder`, with the names of its threads told to the kernel so that their CPU can be told apart."""

from __future__ import annotations

import ctypes
import sys
import threading

from edge.cli.main import main

PR_SET_NAME = 15


def _name_threads() -> None:
    libc = ctypes.CDLL(None)
    run = threading.Thread.run

    def named(thread: threading.Thread) -> None:
        libc.prctl(PR_SET_NAME, thread.name[:15].encode(), 0, 0, 0)
        run(thread)

    threading.Thread.run = named  # type: ignore[method-assign]


if __name__ == "__main__":
    _name_threads()
    sys.exit(main(["recorder", *sys.argv[1:]]))
