"""The sensors: a line for each stream, and for what is wrong."""

from __future__ import annotations

from itertools import zip_longest

from textual.app import ComposeResult
from textual.containers import VerticalScroll

from ui.history import History
from ui.pieces import Pieces, plain
from ui.sensors import columns, header, rows
from ui.situation import Situation
from ui.vitals import detecting_line, gnss_line, location_line, mapped_line
from ui.widgets.line import Line

ROWS = 24
"""Made in advance: three sensors with all that can be wrong with them. More are added when needed."""

TALL = 32
"""A screen with this many rows has room for an empty one between the sensors, whatever is wrong with them."""


class SensorTable(VerticalScroll, can_focus=False):
    """Lines are reused and only added or hidden, so that a steady table sends nothing but its changed cells."""

    DEFAULT_CSS = """
    SensorTable {
        height: 1fr; margin: 1 1 0 1; scrollbar-size-vertical: 1;
        Line { height: auto; text-wrap: wrap; }
        Line.-stale { color: $quiet-text; }
    }
    """

    def __init__(self) -> None:
        super().__init__()
        self._rows = [Line() for _ in range(ROWS)]

    def compose(self) -> ComposeResult:
        yield from self._rows

    def show(self, situation: Situation, history: History) -> None:
        lines = self._lines(situation, history)
        added = [Line() for _ in range(len(lines) - len(self._rows))]
        if added:
            self._rows.extend(added)
            self.mount(*added)
        for line, pieces in zip_longest(self._rows, lines):
            line.display = pieces is not None
            if pieces is not None:
                line.show(pieces, situation.stale)

    def _lines(self, situation: Situation, history: History) -> list[Pieces]:
        widths = columns(self.app.size.width - 3)
        status = situation.status
        lines = [gnss_line(status.gnss if status else None)]
        if status is not None and status.location is not None:
            lines.append(location_line(status.location))
        if status is not None and status.detecting is not None:
            lines.append(detecting_line(status.detecting))
        if status is not None and status.mapped is not None:
            lines.append(mapped_line(status.mapped))
        lines.append(header(widths))
        for sensor in status.sensors if status else ():
            if self.app.size.height >= TALL:
                lines.append(plain(""))
            lines.extend(rows(sensor, history, widths, situation.state == "recording"))
        return lines
