"""One session being written."""

from __future__ import annotations

from pathlib import Path

from edge.config import Config
from edge.recording.account import RecordingStatus, Repair, SessionAbout, SessionResult, TopicDrops, Verdict
from edge.recording.anchor import Anchor
from edge.recording.messages import Recordable

__all__ = [
    "RecordingStatus",
    "Repair",
    "SessionAbout",
    "SessionRecorder",
    "SessionResult",
    "TopicDrops",
    "Verdict",
    "repair_leftovers",
    "session_folder",
    "set_verdict",
]


class SessionRecorder:
    """Writes one session: `offer` from any thread, one writer thread, one thread that finishes splits."""

    def __init__(self, folder: Path, about: SessionAbout, config: Config, anchor: Anchor) -> None:
        """folder: the session's own folder, from `session_folder`; it does not exist yet."""
        raise NotImplementedError

    def start(self) -> None:
        """Make the folder, open the first split, start to write. RecordingError when the disk refuses or is full."""
        raise NotImplementedError

    def offer(self, message: Recordable) -> None:
        """Take a message off the caller's hands. Any thread; never blocks and never raises."""
        raise NotImplementedError

    def status(self) -> RecordingStatus:
        """Any thread."""
        raise NotImplementedError

    def stop(self, reason: str) -> SessionResult:
        """Write what is queued, finish the splits and the files beside them. Idempotent, never raises."""
        raise NotImplementedError


def session_folder(recordings: Path, mission: str, anchor: Anchor) -> Path:
    """A folder for a new session that does not exist yet: `<UTC start>_<mission>`."""
    raise NotImplementedError


def set_verdict(folder: Path, verdict: Verdict) -> None:
    """Write the validator's word into the session's `session.json`."""
    raise NotImplementedError


def repair_leftovers(recordings: Path) -> list[Repair]:
    """Finish what a power cut left open below `recordings`. At start-up, before any session."""
    raise NotImplementedError
