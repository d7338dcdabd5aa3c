"""The recorder's numbers, a label above a value."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import Grid, Vertical

from ui.pieces import Pieces
from ui.situation import Situation
from ui.tone import Tone
from ui.vitals import LABELS, Vital, vitals
from ui.widgets.line import Line


class Cell(Vertical):
    """One number with its label."""

    DEFAULT_CSS = "Cell { height: 2; }"

    def __init__(self) -> None:
        super().__init__()
        self._label, self._value = Line(), Line()

    def compose(self) -> ComposeResult:
        yield self._label
        yield self._value

    def show(self, vital: Vital, stale: bool) -> None:
        style = vital.tone.text if vital.tone in (Tone.WARN, Tone.BAD) else Tone.QUIET.text
        label: Pieces = ((vital.label, style),)
        value: Pieces = ((vital.shown, "bold" if vital.tone is Tone.QUIET else vital.tone.text),)
        self._label.show(label, stale)
        self._value.show(value, stale)


class Vitals(Grid):
    """All cells side by side; two rows of four on a narrow screen."""

    DEFAULT_CSS = """
    Vitals {
        grid-size: 8; grid-rows: 2; grid-gutter: 0; height: 2; margin: 1 1 0 1;
        &.-narrow { grid-size: 4; height: 4; }
    }
    """

    def __init__(self) -> None:
        super().__init__()
        self._cells = tuple(Cell() for _ in LABELS)

    def compose(self) -> ComposeResult:
        yield from self._cells

    def show(self, situation: Situation) -> None:
        self.set_class(self.app.size.width < 72, "-narrow")
        for cell, vital in zip(self._cells, vitals(situation.status), strict=True):
            cell.show(vital, situation.stale)
