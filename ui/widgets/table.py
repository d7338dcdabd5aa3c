"""The sensors: a line for each stream, and for what is wrong."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import VerticalScroll

from ui.history import History
from ui.pieces import Pieces
from ui.sensors import columns, header, rows
from ui.situation import Situation
from ui.vitals import gnss_line
from ui.widgets.line import Line


class SensorTable(VerticalScroll, can_focus=False):
    """Lines are reused and only added or hidden, so that a steady table sends nothing but its changed cells."""

    DEFAULT_CSS = """
    SensorTable {
        height: 1fr; margin: 1 1 0 1; scrollbar-size-vertical: 1;
        Line { height: auto; text-wrap: wrap; }
        Line.-stale { color: $quiet-text; }
    }
    """

    def compose(self) -> ComposeResult:
        yield Line()

    def show(self, situation: Situation, history: History) -> None:
        lines = self._lines(situation, history)
        shown = list(self.query(Line))
        added = [Line() for _ in range(len(lines) - len(shown))]
        if added:
            self.mount(*added)
        for line, pieces in zip(shown + added, lines, strict=False):
            line.show(pieces, situation.stale)
        for index, line in enumerate(shown + added):
            line.display = index < len(lines)

    def _lines(self, situation: Situation, history: History) -> list[Pieces]:
        widths = columns(self.app.size.width - 3)
        status = situation.status
        lines = [gnss_line(status.gnss if status else None), header(widths)]
        for sensor in status.sensors if status else ():
            lines.extend(rows(sensor, history, widths, situation.state == "recording"))
        return lines
