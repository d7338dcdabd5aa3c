"""The answer to the last key, above the keys."""

from __future__ import annotations

from ui.pieces import Pieces
from ui.tone import Tone
from ui.widgets.line import Line


class Notice(Line):
    """One line, or two for a long error. Empty while there is nothing to say."""

    DEFAULT_CSS = """
    Notice { height: auto; max-height: 3; padding: 0 1; text-wrap: wrap; display: none; }
    """

    def say(self, text: str, tone: Tone = Tone.QUIET) -> None:
        """Show `text` until something else is said; an empty text clears the line."""
        self.display = bool(text)
        pieces: Pieces = ((f" {tone.symbol} {text} ", tone.badge),) if text else (("", ""),)
        self.show(pieces)
