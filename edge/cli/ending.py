"""A closed terminal and a polite kill end a command as Ctrl-C does: through every clean-up."""

from __future__ import annotations

import signal
from types import FrameType


def end_with_the_terminal() -> None:
    """From now on SIGHUP and SIGTERM raise KeyboardInterrupt in the main thread."""
    for number in (signal.SIGHUP, signal.SIGTERM):
        signal.signal(number, _interrupt)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
