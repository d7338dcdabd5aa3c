"""How much something matters, told three ways at once: a symbol, a word and a colour."""

from __future__ import annotations

from enum import Enum


class Tone(Enum):
    """Worst last. The value names the theme's variables (`$good`, `$on-good`, `$good-text`)."""

    QUIET = "quiet"
    """Neither good nor bad: labels, what is idle, what is unknown."""
    GOOD = "good"
    WARN = "warn"
    BAD = "bad"

    @property
    def text(self) -> str:
        """Style of a word in running text. Bold where it must not be overlooked."""
        return f"${self.value}-text" if self is Tone.QUIET else f"bold ${self.value}-text"

    @property
    def badge(self) -> str:
        """Style of a filled label."""
        return f"bold $on-{self.value} on ${self.value}"

    @property
    def symbol(self) -> str:
        """Told apart by shape alone. None of these has an emoji form, which phones would draw two cells wide."""
        return SYMBOLS[self]


SYMBOLS = {Tone.QUIET: "○", Tone.GOOD: "✓", Tone.WARN: "▲", Tone.BAD: "✗"}


def worst(*tones: Tone) -> Tone:
    """The tone that needs attention most; QUIET for none at all."""
    order = list(Tone)
    return max(tones, key=order.index, default=Tone.QUIET)
