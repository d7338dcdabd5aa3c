"""What is said about a session: before it, while it runs, and after."""

from __future__ import annotations

from pathlib import Path

import msgspec


class SessionAbout(msgspec.Struct, frozen=True, kw_only=True):
    """What is known when a session starts. Goes into `session.json` and into every split."""

    mission: str = "mission"
    operator: str = ""
    carrier: str = "handheld"
    software: str = ""
    config_toml: str = ""
    """The configuration file as written by its author; empty when there was none."""
    host: str = ""
    clock_synchronised: bool = False
    """Whether the system clock was disciplined when the session was anchored."""
    clock_source: str = ""


class TopicDrops(msgspec.Struct, frozen=True):
    """Messages of one topic the queue had no room for. Stamps are session time."""

    count: int
    first_ns: int
    last_ns: int


class RecordingStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The session while it is written."""

    session: str
    folder: str
    elapsed_s: float
    bytes_written: int
    messages: int
    dropped: dict[str, TopicDrops]
    """By topic, since the start."""
    queue_fill: float
    """0..1 of the queue's bytes, what the writer holds in its hands included."""
    flush_ms: float
    """How long the last flush to the disk took."""
    flush_worst_ms: float
    split: int
    marks: int
    last_progress_ns: int
    """Host time of the writer's last sign of life; it stands still while a disk call hangs."""
    disk_free_bytes: int
    ended: str = ""
    """Why the recording ended by itself (disk reserve, disk error); empty while it runs. Call `stop` then."""
    error: str = ""
    """What went wrong and what to do; empty when nothing did."""


class SessionResult(msgspec.Struct, frozen=True, kw_only=True):
    """The session after its end."""

    session: str
    folder: Path
    reason: str
    error: str
    duration_s: float
    bytes_written: int
    messages: int
    counts: dict[str, int]
    """Messages by topic."""
    dropped: dict[str, TopicDrops]
    splits: tuple[str, ...]
    """File names in order."""
    not_kept: int = 0
    """Messages the disk refused after they had left the queue; 0 unless there was a disk error."""


class Verdict(msgspec.Struct, frozen=True):
    """The validator's word, kept in `session.json`: PASS, WARN or FAIL with reasons, worst first."""

    verdict: str
    reasons: tuple[str, ...] = ()


class Repair(msgspec.Struct, frozen=True):
    """What was done at start-up to one file a power cut left open."""

    session: str
    folder: Path
    file: str
    messages: int
    lost_bytes: int
    error: str = ""
    """Why the file could not be repaired; it is left as it is then."""
