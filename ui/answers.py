"""What became of a request, in a line."""

from __future__ import annotations

from edge.control.messages import Reply, Request
from ui.tone import Tone

_DONE = {
    "start": "Recording {session}",
    "stop": "Stopped {session}. Checking the recording.",
    "mark": "Marked.",
    "validate": "Checking {session}",
}
NOT_SENT = "NOT sent: the recorder is not reachable. Press again when it is back."


def answer(request: Request, reply: Reply) -> tuple[str, Tone]:
    """The notice for a reply."""
    if not reply.ok:
        return f"{request.command} refused: {reply.error or 'no reason given'}", Tone.BAD
    text = _DONE.get(request.command, request.command)
    if request.command == "mark" and request.text:
        text = f"Marked: {request.text}"
    return text.format(session=reply.session).rstrip(), Tone.GOOD


def unanswered(request: Request, after_s: float) -> tuple[str, Tone]:
    """The notice for a reply that did not come."""
    return f"No answer to {request.command} within {after_s:.0f} s. The banner shows what is so.", Tone.WARN


def goodbye(state: str, session: str) -> str:
    """The last word after leaving the screen; empty when there is nothing to say."""
    if state not in {"recording", "stopping"}:
        return ""
    return (
        f"The recording goes on: {session}\n  back to the screen: mapforest tui\n  stop the recording: mapforest stop"
    )


def noted(text: str, typed_s: float) -> str:
    """A mark's text that says how long ago it was meant: typing takes a while, and the mark is stamped on arrival."""
    return f"{text} ({typed_s:.0f} s ago)".lstrip() if typed_s >= 1.5 else text
