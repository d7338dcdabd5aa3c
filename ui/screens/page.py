"""A page of text over the main screen: help, and the verdict in full."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Footer

from ui.pieces import Pieces
from ui.widgets.line import Line


class PageScreen(ModalScreen[None]):
    """Scrolls with the arrows; any of the usual keys closes it."""

    DEFAULT_CSS = """
    PageScreen {
        background: $background;
        VerticalScroll { padding: 0 1; scrollbar-size-vertical: 1; }
        Line { height: auto; text-wrap: wrap; }
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,q,h,question_mark,v,enter", "dismiss", "Back", key_display="ESC"),
        Binding("down,j", "page(1)", "Scroll", key_display="ARROWS"),
        Binding("up,k", "page(-1)", "Up", show=False),
    ]

    def __init__(self, lines: tuple[Pieces, ...]) -> None:
        super().__init__()
        self._lines = lines

    def compose(self) -> ComposeResult:
        with VerticalScroll(can_focus=False):
            for _ in self._lines:
                yield Line()
        yield Footer(show_command_palette=False)

    def on_mount(self) -> None:
        for line, pieces in zip(self.query(Line), self._lines, strict=True):
            line.show(pieces)

    def action_page(self, lines: int) -> None:
        self.query_one(VerticalScroll).scroll_relative(y=3 * lines, animate=False)
