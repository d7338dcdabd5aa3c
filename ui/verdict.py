"""The validator's word after a stop."""

from __future__ import annotations

from edge.control.messages import Verdict
from ui.pieces import Pieces, badge
from ui.tone import Tone

_TONES = {"PASS": Tone.GOOD, "WARN": Tone.WARN}
_MEANINGS = {
    "PASS": "The recording is good.",
    "WARN": "The recording is usable. Read this before you leave.",
    "FAIL": "The recording is NOT good. Record again if you can.",
}


def verdict_tone(verdict: Verdict) -> Tone:
    return Tone.QUIET if verdict.running else _TONES.get(verdict.verdict, Tone.BAD)


def verdict_lines(verdict: Verdict, most: int) -> tuple[Pieces, ...]:
    """The verdict with at most `most` of its reasons, the worst first, and how many more there are."""
    if verdict.running:
        return ((*badge("CHECKING", Tone.QUIET), (f"  {verdict.session}", "")),)
    tone = verdict_tone(verdict)
    meaning = _MEANINGS.get(verdict.verdict, "")
    head: Pieces = (*badge(verdict.verdict, tone), (f"  {meaning}", "bold"))
    reasons = tuple(((f" {tone.symbol} {reason}", ""),) for reason in verdict.reasons[:most])
    more = len(verdict.reasons) - most
    tail: tuple[Pieces, ...] = (((f"   {more} more: press V", "$quiet-text"),),) if more > 0 else ()
    return (head, *reasons, *tail)


def verdict_page(verdict: Verdict) -> tuple[Pieces, ...]:
    """The verdict in full, with the session it is about."""
    session: Pieces = ((verdict.session, "bold"),)
    blank: Pieces = (("", ""),)
    return (session, blank, *verdict_lines(verdict, len(verdict.reasons)))
