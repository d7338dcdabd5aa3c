"""Styled text as plain data, so that what is shown can be tested without a terminal."""

from __future__ import annotations

from ui.tone import Tone

Pieces = tuple[tuple[str, str], ...]
"""(text, style) pairs in reading order. A style is empty or names theme variables."""


def plain(text: str) -> Pieces:
    return ((text, ""),)


def toned(text: str, tone: Tone) -> Pieces:
    """Text in the colour of its tone, its symbol in front."""
    return ((f"{tone.symbol} {text}", tone.text),)


def badge(word: str, tone: Tone, width: int = 0) -> Pieces:
    """A filled label, ` ✓ OK `, at least `width` cells."""
    return ((f" {tone.symbol} {word} ".ljust(width), tone.badge),)


def text_of(pieces: Pieces) -> str:
    """What remains without colour."""
    return "".join(text for text, _ in pieces)


def fit(text: str, width: int) -> str:
    """Cut to `width` cells, with an ellipsis where something was cut."""
    return text if len(text) <= width else text[: max(0, width - 1)] + "…" * (width > 0)
