"""A line of text that is only drawn again when it changed."""

from __future__ import annotations

from textual.content import Content
from textual.widgets import Static

from ui.glyphs import plain
from ui.pieces import Pieces


class Line(Static):
    """Everything that changes on the screen is one of these: over a slow link only the lines that differ travel.

    An app that sets `ascii_only` gets plain characters; stale text loses its colours.
    """

    DEFAULT_CSS = """
    Line { height: 1; text-wrap: nowrap; text-overflow: ellipsis; }
    Line.-stale { color: $quiet-text; }
    """

    def show(self, pieces: Pieces, stale: bool = False) -> None:
        """Show `pieces`. `stale`: it was true once, and is shown as such."""
        content = Content.assemble(*((text, "" if stale else style) for text, style in pieces))
        if getattr(self.app, "ascii_only", False):
            content = plain(content)
        self.set_class(stale, "-stale")
        before = self.content
        if isinstance(before, Content) and before.is_same(content):
            return
        # Only a line that may wrap can change its height, and a new layout of the screen costs far more than a redraw.
        wraps = isinstance(before, Content) and max(len(before), len(content)) > self.size.width
        self.update(content, layout=wraps or not isinstance(before, Content))
