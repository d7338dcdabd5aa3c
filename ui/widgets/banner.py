"""Recording or not, in letters three rows high, filled with the colour of how things are."""

from __future__ import annotations

from textual import events
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.message import Message

from ui.headline import Headline, headline
from ui.letters import ROWS, big
from ui.pieces import fit, plain
from ui.situation import Situation
from ui.tone import Tone
from ui.widgets.line import Line


class Banner(Vertical):
    """Word and stop watch, detail, news, and what to do when there is no contact. A tap on it is a press of the key."""

    DEFAULT_CSS = """
    Banner {
        height: auto; padding: 0 1;
        Line { text-style: bold; }
        &.-quiet { background: $quiet; color: $on-quiet; }
        &.-good { background: $good; color: $on-good; }
        &.-warn { background: $warn; color: $on-warn; }
        &.-bad { background: $bad; color: $on-bad; }
    }
    """

    class Tapped(Message):
        """The banner was tapped or clicked."""

    def __init__(self) -> None:
        super().__init__()
        self._large = tuple(Line() for _ in range(ROWS))
        self._detail, self._news, self._advice = Line(), Line(), Line()

    def compose(self) -> ComposeResult:
        yield from (*self._large, self._detail, self._news, self._advice)

    def show(self, situation: Situation) -> None:
        shown = headline(situation)
        for tone in Tone:
            self.set_class(tone is shown.tone, f"-{tone.value}")
        width = max(self.app.size.width - 2, 0)
        for line, text in zip(self._large, _large(shown, width), strict=True):
            line.show(plain(text))
        self._detail.show(plain(fit(shown.detail, width)))
        own = shown.tone in (shown.news_tone, Tone.GOOD) or shown.news_tone in (Tone.QUIET, Tone.GOOD)
        self._news.show(((fit(shown.news, width), "" if own else shown.news_tone.badge),))
        self._advice.show(plain(fit(shown.advice, width)))
        self._advice.display = bool(shown.advice)

    def on_click(self, event: events.Click) -> None:
        event.stop()
        self.post_message(self.Tapped())


def _large(shown: Headline, width: int) -> tuple[str, str, str]:
    """Word to the left, stop watch to the right; a narrow screen gets the clock, then the word, in plain text."""
    word = big(shown.word)
    if not shown.clock:
        return word if len(word[0]) <= width else ("", shown.word, "")
    clock = big(shown.clock)
    gap = width - len(word[0]) - len(clock[0])
    if gap >= 2:
        top, middle, bottom = (left + " " * gap + right for left, right in zip(word, clock, strict=True))
        return top, middle, bottom
    if len(word[0]) + len(shown.clock) + 2 <= width:
        return word[0], f"{word[1]}  {shown.clock}", word[2]
    return "", f"{shown.word}  {shown.clock}", ""
