"""The help page."""

from __future__ import annotations

from ui.pieces import Pieces, badge
from ui.tone import Tone

KEYS = (
    ("SPACE  R", "start recording; twice within 3 s: stop. A tap on the banner does the same"),
    ("M", "mark this moment"),
    ("N", "mark this moment, with a few words"),
    ("V", "the verdict on the last recording, in full"),
    ("C", "change the colours: shade, sun"),
    ("B", "bell on a new fault: on, off"),
    ("P", "all actions by name"),
    ("Q", "leave this screen. A recording goes on"),
)
STATES = (
    (Tone.GOOD, "OK", "delivers what it should"),
    (Tone.WARN, "SEARCHING", "not found yet. Switched on? Cable, Wi-Fi? While recording: red"),
    (Tone.WARN, "STARTING", "found, not delivering yet. Wait a little"),
    (Tone.WARN, "DEGRADED", "delivers, with losses or poor quality: read its line"),
    (Tone.BAD, "FAILED", "refuses or is broken: do what its line says"),
)
WORDS = (
    ("Green banner", "recording, all good"),
    ("Yellow banner", "recording, something to look at"),
    ("Red banner", "recording with a hole in it, or no contact with the recorder"),
    ("Plain banner", "NOT recording"),
    ("RATE", "messages a second; the bars are the last seconds, two thirds up is right"),
    ("LOST GAP", "losses since the sensor started; longest silence just now"),
    ("CLOCK", "how well the sensor's clock is known; a warning from 5 ms on"),
    ("QUEUE", "what waits for the card. It fills when the card is slow; full means losses"),
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
        (("The recorder works on its own. Closing this screen, or losing the connection, stops nothing.", "bold"),),
    )
