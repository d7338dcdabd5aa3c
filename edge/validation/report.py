"""The verdict on a recording and what it rests on."""

from __future__ import annotations

from enum import Enum
from functools import total_ordering
from typing import Literal

import msgspec


@total_ordering
class Level(Enum):
    """How bad a finding is, ordered. A NOTE does not touch the verdict."""

    NOTE = "NOTE"
    WARN = "WARN"
    FAIL = "FAIL"

    def __lt__(self, other: Level) -> bool:
        return _RANK.index(self) < _RANK.index(other)


_RANK = (Level.NOTE, Level.WARN, Level.FAIL)


class Finding(msgspec.Struct, frozen=True):
    """One thing found. `topic` is empty when it is about the whole recording; `advice` says what to do about it."""

    level: Level
    topic: str
    text: str
    advice: str = ""


class TopicReport(msgspec.Struct, frozen=True):
    """One line of the table. Seconds count from the session's start, `ends_before_s` from its end."""

    name: str
    type_name: str
    count: int
    expected_hz: float | None
    rate_hz: float
    largest_gap_s: float
    gap_at_s: float
    starts_s: float
    ends_before_s: float
    required: bool
    level: Level


class FileReport(msgspec.Struct, frozen=True):
    """One file of the recording."""

    name: str
    size_bytes: int
    finished: bool
    messages: int


class GnssShare(msgspec.Struct, frozen=True):
    """Share of GNSS epochs with any fix, and epochs by quality in words. `source` says where it is from."""

    epochs: int
    fix_share: float
    qualities: dict[str, int]
    source: str


class Report(msgspec.Struct, frozen=True):
    """What `validate` found out."""

    target: str
    verdict: Literal["PASS", "WARN", "FAIL"]
    reasons: tuple[str, ...]
    """Worst first, in plain words, each with what to do."""
    findings: tuple[Finding, ...]
    topics: tuple[TopicReport, ...]
    files: tuple[FileReport, ...]
    missing: tuple[str, ...]
    """Required topics without a single message."""
    own: bool
    """Recorded by mapforest; otherwise topics were recognised by their types."""
    start_ns: int
    duration_s: float
    size_bytes: int
    messages: int
    gnss: GnssShare | None
    clock_sigma_ms: dict[str, float]
    """Worst known clock uncertainty by sensor."""
    dropped: dict[str, int]
    lost: dict[str, int]
    """Losses counted by the sensors' drivers, by sensor and stream."""
    elapsed_s: float
    """How long the validation took."""


def verdict_of(findings: tuple[Finding, ...]) -> Literal["PASS", "WARN", "FAIL"]:
    """The worst finding decides."""
    worst = max((finding.level for finding in findings), default=Level.NOTE)
    return "FAIL" if worst is Level.FAIL else "WARN" if worst is Level.WARN else "PASS"


def reasons_of(findings: tuple[Finding, ...]) -> tuple[str, ...]:
    """Findings that touch the verdict, worst first, as sentences."""
    ranked = sorted((f for f in findings if f.level > Level.NOTE), key=lambda finding: finding.level, reverse=True)
    return tuple(f"{finding.text} {finding.advice}".strip() for finding in ranked)
