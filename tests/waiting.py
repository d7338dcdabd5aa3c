"""Waiting for something to become true, with a deadline, in tests."""

import threading
import time
from collections.abc import Callable

PATIENCE_S = 90.0
"""How long a test waits for what has to come. It ends a hang and measures nothing: a busy machine may take its time."""


def wait_for(predicate: Callable[[], object], timeout_s: float = PATIENCE_S, interval_s: float = 0.01) -> None:
    """Return when `predicate` holds; fail the test when it does not within `timeout_s`."""
    deadline = time.monotonic() + timeout_s
    pause = threading.Event()
    while not predicate():
        assert time.monotonic() < deadline, f"not true within {timeout_s} s: {predicate}"
        pause.wait(interval_s)
