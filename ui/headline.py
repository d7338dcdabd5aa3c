"""The one thing to see from afar: recording or not, and whether all is well."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

from edge.control.messages import Recording, Status
from ui import units
from ui.faults import faults
from ui.situation import Link, Situation
from ui.tone import Tone, worst

WHAT_TO_DO = "Is the payload on? See: systemctl status mapforest-recorder"


@dataclass(frozen=True)
class Headline:
    """word and clock are drawn large; detail, news (in a tone of its own) and advice are a line each below."""

    word: str
    tone: Tone
    detail: str
    news: str = ""
    clock: str = ""
    advice: str = ""
    news_tone: Tone = Tone.QUIET


def headline(situation: Situation) -> Headline:
    """What the banner says."""
    status = situation.status
    if situation.stale or status is None:
        return _out_of_contact(situation)
    if status.state == "recording":
        return _recording(situation, status)
    news, news_tone = _news(situation)
    if status.state == "stopping":
        wait = "Writing the last data to the card. Leave the power on."
        return Headline("STOPPING", Tone.WARN, wait, news, news_tone=news_tone)
    return Headline("NOT RECORDING", Tone.QUIET, "Press SPACE to start.", news, news_tone=news_tone)


def last_seen(situation: Situation) -> str:
    """What was so before the contact broke, and that it goes on without this screen."""
    status = situation.status
    if status is None:
        return "Nothing received yet."
    ago = units.age(situation.status_age_s)
    if status.recording is not None and status.state == "recording":
        seen = f"Last seen {ago} ago: RECORDING {units.elapsed(status.recording.elapsed_s)}"
        return f"{seen}. It needs no screen to go on."
    return f"Last seen {ago} ago: {status.state}. What is shown below is that old."


def _out_of_contact(situation: Situation) -> Headline:
    if situation.link is Link.CONNECTING:
        return Headline("CONNECTING", Tone.WARN, "Looking for the recorder.", last_seen(situation))
    detail = f"Trying again. {situation.link_problem}"
    if situation.link is Link.ONLINE:
        detail = f"The recorder is there, and silent for {units.age(situation.status_age_s)}."
    return Headline("NO CONTACT", Tone.BAD, detail, last_seen(situation), advice=WHAT_TO_DO)


def _recording(situation: Situation, status: Status) -> Headline:
    clock = units.elapsed(status.recording.elapsed_s) if status.recording else ""
    news, tone = _news(situation)
    if situation.armed_s > 0:
        ask = f"Press SPACE once more within {ceil(situation.armed_s)} s to STOP. Esc: go on recording."
        return Headline("STOP?", Tone.WARN, ask, news, clock, news_tone=tone)
    return Headline("RECORDING", tone, _session(status.recording), news, clock, news_tone=tone)


def _session(recording: Recording | None) -> str:
    if recording is None:
        return ""
    marks = f"{recording.marks} mark{'s' * (recording.marks != 1)}"
    return f"{recording.session} · {marks} · {units.count(recording.messages)} messages"


def _news(situation: Situation) -> tuple[str, Tone]:
    found = faults(situation)
    if not found:
        return f"{Tone.GOOD.symbol} All good.", Tone.GOOD
    return "  ".join(f"{fault.tone.symbol} {fault.text}" for fault in found), worst(*(fault.tone for fault in found))
