"""The verdict on the last session, while nothing is being recorded."""

from __future__ import annotations

from itertools import zip_longest

from textual.app import ComposeResult
from textual.containers import Vertical

from ui.situation import Situation
from ui.verdict import verdict_lines
from ui.widgets.line import Line

REASONS = 2
"""Two lines each, with what to do: as many as leave the sensors visible on 24 rows."""


class VerdictPanel(Vertical):
    """Hidden during a recording: the last one is no longer what matters."""

    DEFAULT_CSS = """
    VerdictPanel { height: auto; margin: 1 1 0 1; display: none; }
    VerdictPanel Line { height: auto; text-wrap: wrap; }
    """

    def __init__(self) -> None:
        super().__init__()
        self._rows = tuple(Line() for _ in range(REASONS + 2))

    def compose(self) -> ComposeResult:
        yield from self._rows

    def show(self, situation: Situation) -> None:
        status = situation.status
        verdict = status.verdict if status and status.state == "idle" else None
        self.display = verdict is not None
        if verdict is None:
            return
        lines = verdict_lines(verdict, REASONS)
        for line, pieces in zip_longest(self._rows, lines):
            line.display = pieces is not None
            if pieces is not None:
                line.show(pieces, situation.stale)
