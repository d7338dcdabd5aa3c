"""A thread that does slow disk work in order, so that the writer need not wait for it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from queue import SimpleQueue
from threading import Thread

_log = logging.getLogger(__name__)


class Background:
    """Jobs run one after the other. A job that fails is logged, kept in `error`, and the next one runs."""

    def __init__(self, name: str) -> None:
        self.error = ""
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, job: Callable[[], None]) -> None:
        self._jobs.put(job)

    def join(self) -> None:
        """Return when everything submitted is done."""
        self._jobs.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            try:
                job()
            except Exception as error:
                _log.exception("disk work of the recorder failed")
                self.error = str(error)
