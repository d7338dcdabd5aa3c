"""Reading ahead: the disk and the decoder work while the estimator does."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable, Iterator
from typing import Generic, TypeVar

ItemT = TypeVar("ItemT")
_WAKE_S = 0.2


class _End(Generic[ItemT]):
    """The last thing in the queue, with what ended the iteration, if it was an error."""

    def __init__(self, error: BaseException | None) -> None:
        self.error = error


def ahead(items: Iterable[ItemT], depth: int) -> Iterator[ItemT]:
    """The same items, up to `depth` of them made beforehand in a thread. Errors come out here."""
    made: queue.Queue[ItemT | _End[ItemT]] = queue.Queue(depth)
    left = threading.Event()
    thread = threading.Thread(target=_make, args=(items, made, left), name="read-ahead", daemon=True)
    thread.start()
    try:
        while not isinstance(item := made.get(), _End):
            yield item
        if item.error is not None:
            raise item.error
    finally:
        left.set()
        thread.join()


def _make(items: Iterable[ItemT], made: queue.Queue[ItemT | _End[ItemT]], left: threading.Event) -> None:
    """Thread root."""
    error: BaseException | None = None
    try:
        for item in items:
            if not _put(made, item, left):
                return
    except Exception as raised:  # the thread's root: it is raised again where the items are used
        error = raised
    _put(made, _End(error), left)


def _put(made: queue.Queue[ItemT | _End[ItemT]], item: ItemT | _End[ItemT], left: threading.Event) -> bool:
    """False when nobody takes items any more."""
    while not left.is_set():
        try:
            made.put(item, timeout=_WAKE_S)
        except queue.Full:
            continue
        return True
    return False
