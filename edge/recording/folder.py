"""The session's folder: its name, and `session.json`, which says in one place what was recorded."""

from __future__ import annotations

import re
from datetime import datetime, timezone
from pathlib import Path

import msgspec

from edge.errors import FormatError
from edge.recording.account import SessionAbout, TopicDrops, Verdict
from edge.recording.anchor import Anchor
from edge.recording.bag import SplitFacts
from edge.recording.disk import Disk
from edge.recording.summary import ClockNote, MarkNote

SESSION_JSON = "session.json"
_NAME_LENGTH = 48


class SessionRecord(msgspec.Struct, frozen=True, kw_only=True):
    """`session.json`. state: recording, finished, or unclean (the power went, repaired at the next start)."""

    version: int = 1
    session: str
    state: str
    about: SessionAbout
    started_utc: str
    anchor_utc_ns: int
    anchor_monotonic_ns: int
    reason: str = ""
    """Why it ended."""
    error: str = ""
    duration_s: float = 0.0
    bytes_written: int = 0
    messages: int = 0
    counts: dict[str, int] = {}
    dropped: dict[str, TopicDrops] = {}
    not_kept: int = 0
    """Messages the disk refused after they had left the queue; 0 unless there was a disk error."""
    splits: tuple[SplitFacts, ...] = ()
    gnss_quality: dict[str, int] = {}
    events: dict[str, int] = {}
    marks: tuple[MarkNote, ...] = ()
    clock: ClockNote | None = None
    flush_worst_ms: float = 0.0
    config_toml: str = ""
    calibration_toml: str = ""
    verdict: Verdict | None = None


def session_folder(recordings: Path, mission: str, anchor: Anchor) -> Path:
    """A folder for a new session that does not exist yet: `<UTC start>_<mission>`."""
    start = datetime.fromtimestamp(anchor.utc_ns // 1_000_000_000, timezone.utc)
    name = f"{start:%Y%m%dT%H%M%SZ}_{safe_name(mission)}"
    folder, number = recordings / name, 2
    while folder.exists():
        folder = recordings / f"{name}-{number}"
        number += 1
    return folder


def utc_text(utc_ns: int) -> str:
    """ISO 8601 with milliseconds."""
    seconds, rest_ns = divmod(utc_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, timezone.utc):%Y-%m-%dT%H:%M:%S}.{rest_ns // 1_000_000:03d}Z"


def safe_name(text: str) -> str:
    """What any file system and shell takes as part of a name; "mission" when nothing is left."""
    words = re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-._")
    return words[:_NAME_LENGTH].rstrip("-._") or "mission"


def read_session(folder: Path) -> SessionRecord:
    """FormatError when `session.json` is missing or not what it should be."""
    path = folder / SESSION_JSON
    try:
        return msgspec.json.decode(path.read_bytes(), type=SessionRecord)
    except (OSError, msgspec.MsgspecError) as error:
        raise FormatError(f"{path}: not the record of a session: {error}") from error


def write_session(disk: Disk, folder: Path, record: SessionRecord) -> None:
    """Atomic. OSError when the disk refuses."""
    disk.replace(folder / SESSION_JSON, msgspec.json.format(msgspec.json.encode(record), indent=2) + b"\n")


def set_verdict(folder: Path, verdict: Verdict) -> None:
    """Write the validator's word into the session's `session.json`. FormatError when there is none."""
    write_session(Disk(), folder, msgspec.structs.replace(read_session(folder), verdict=verdict))
