"""A mark with words."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Input, Label


class NoteScreen(ModalScreen[str | None]):
    """Asks for the text of a mark. Enter sets it, also without text; Esc sets none."""

    DEFAULT_CSS = """
    NoteScreen {
        align: center middle; background: $background 60%;
        Vertical { width: 90%; max-width: 72; height: auto; padding: 1 2; background: $quiet; color: $on-quiet; }
        Input { margin: 1 0; border: none; height: 1; padding: 0 1; }
        Input:focus { border: none; }
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", "Set no mark")]

    def compose(self) -> ComposeResult:
        with Vertical():
            yield Label("What is here? The time is that of the key press.")
            text = Input(placeholder="e.g. Ailanthus seedlings, left of the trail", max_length=200)
            text.cursor_blink = False
            yield text
            yield Label("Enter: set the mark   Esc: leave it")

    def on_input_submitted(self, event: Input.Submitted) -> None:
        self.dismiss(event.value.strip())
