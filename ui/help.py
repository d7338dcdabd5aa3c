"""The help page."""

from __future__ import annotations

from ui.pieces import Pieces, badge
from ui.tone import Tone

KEYS = (
    ("SPACE  R", "start; twice within 3 s: stop. So does a tap on the banner"),
    ("M", "mark this moment"),
    ("N", "mark this moment, with a few words"),
    ("V", "the verdict on the last recording, in full"),
    ("C", "change the colours: shade, sun"),
    ("B", "bell on a new fault or tree: on, off"),
    ("P", "all actions by name"),
    ("Q", "leave this screen. A recording goes on"),
)
STATES = (
    (Tone.GOOD, "OK", "delivers what it should"),
    (Tone.WARN, "SEARCHING", "not found. Switched on? Cable? Wi-Fi? Red in a recording"),
    (Tone.WARN, "STARTING", "found, not delivering yet. Wait a little"),
    (Tone.WARN, "DEGRADED", "delivers, with losses or poor quality: read its line"),
    (Tone.BAD, "FAILED", "refuses or is broken: do what its line says"),
)
WORDS = (
    ("Green banner", "recording, all good"),
    ("Yellow banner", "recording, something to look at"),
    ("Red banner", "recording with a hole in it, or no contact"),
    ("Plain banner", "NOT recording"),
    ("HZ  TREND", "messages a second; bars: the last seconds, half up is right"),
    ("LOST GAP", "lost since the sensor started; longest silence just now"),
    ("CLOCK", "how well the sensor's clock is known; from 5 ms a warning"),
    ("QUEUE", "what waits for the card. Fills when it is slow; full: losses"),
)


def help_lines() -> tuple[Pieces, ...]:
    """The whole page."""
    blank: Pieces = (("", ""),)
    return (
        (("KEYS", "bold underline"),),
        *(((f"{keys:<15}", "bold $good-text"), (text, "")) for keys, text in KEYS),
        blank,
        (("SENSORS", "bold underline"),),
        *((*badge(word, tone, 13), (f"  {text}", "")) for tone, word, text in STATES),
        blank,
        (("WORDS", "bold underline"),),
        *(((f"{word:<15}", "bold"), (text, "")) for word, text in WORDS),
        blank,
        (("The recorder works on its own: leaving this screen, or losing it, stops nothing.", "bold"),),
    )
