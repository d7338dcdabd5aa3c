"""What a recording says about itself at the end of each split: the metadata record `mapforest`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import msgspec

from drivers.messages import GnssFix, SensorEvent
from edge.recording.account import SessionAbout, TopicDrops
from edge.recording.anchor import Anchor
from edge.recording.messages import Diagnostics, Mark, Recordable
from edge.recording.queue import Drops
from edge.ros.topics import Channel

SESSION_RECORD = "session"
SUMMARY_RECORD = "mapforest"
SUMMARY_KEY = "summary"


class TopicSpan(msgspec.Struct, frozen=True):
    """Messages of one topic in one split; stamps are log times."""

    count: int
    first_ns: int
    last_ns: int


class MarkNote(msgspec.Struct, frozen=True):
    """A mark of the operator, in session time."""

    stamp_ns: int
    text: str


class ClockNote(msgspec.Struct, frozen=True):
    """The host's clock. `drift_ms`: how far UTC of the system has moved from session time since the start."""

    synchronised_at_start: bool
    source: str
    drift_ms: float
    steps: int


class DiagnosticNote(msgspec.Struct, frozen=True):
    """The last word on one part."""

    level: int
    message: str
    values: dict[str, str]


class SplitSummary(msgspec.Struct, frozen=True, kw_only=True):
    """`topics` is about this split; everything else about the session up to the end of this split."""

    version: int = 1
    session: str
    split: int
    ended: str
    """"split" when another follows, else the reason the session ended."""
    topics: dict[str, TopicSpan]
    session_counts: dict[str, int]
    dropped: dict[str, TopicDrops]
    diagnostics: dict[str, DiagnosticNote]
    """Last status of each part by its name; stream losses are among the values of a sensor's."""
    gnss_quality: dict[str, int]
    """Epochs by GGA quality number."""
    clock: ClockNote
    events: dict[str, int]
    """Events by severity."""
    marks: tuple[MarkNote, ...]
    flush_worst_ms: float
    first_diagnostics: dict[str, DiagnosticNote] = {}
    """First status of each part in this session: what a driver had lost before does not count against it."""


class Written(msgspec.Struct, frozen=True):
    """What is in the files: `topics` of the split that ends, `session_counts` by topic of the whole session."""

    session: str
    topics: dict[str, TopicSpan]
    session_counts: dict[str, int]


class Tally:
    """Counts what goes into the file. Used by the writer's thread; its numbers may be read from any."""

    def __init__(self, anchor: Anchor, about: SessionAbout) -> None:
        self._anchor = anchor
        self._about = about
        self.gnss_quality: Counter[str] = Counter()
        self.events: Counter[str] = Counter()
        self.marks: list[MarkNote] = []
        self.diagnostics: dict[str, DiagnosticNote] = {}
        self.first_diagnostics: dict[str, DiagnosticNote] = {}
        self.clock_drift_ns = 0
        self.clock_steps = 0
        self.flush_worst_ms = 0.0

    def add(self, message: Recordable) -> None:
        """One message was written."""
        match message:
            case GnssFix():
                self.gnss_quality[str(int(message.quality))] += 1
            case SensorEvent():
                self.events[message.severity.value] += 1
            case Mark():
                self.marks.append(MarkNote(self._anchor.session_ns(message.stamp_ns), message.text))
            case Diagnostics():
                for status in message.statuses:
                    note = DiagnosticNote(int(status.level), status.message, dict(status.values))
                    self.diagnostics[status.name] = note
                    self.first_diagnostics.setdefault(status.name, note)
            case _:
                pass

    def clock(self) -> ClockNote:
        about = self._about
        drift_ms = self.clock_drift_ns / 1e6
        return ClockNote(about.clock_synchronised, about.clock_source, drift_ms, self.clock_steps)

    def summary(self, split: int, ended: str, written: Written, dropped: dict[str, TopicDrops]) -> SplitSummary:
        """The closing words of a split."""
        return SplitSummary(
            session=written.session,
            split=split,
            ended=ended,
            topics=written.topics,
            session_counts=written.session_counts,
            dropped=dropped,
            diagnostics=dict(self.diagnostics),
            gnss_quality=dict(self.gnss_quality),
            clock=self.clock(),
            events=dict(self.events),
            marks=tuple(self.marks),
            flush_worst_ms=self.flush_worst_ms,
            first_diagnostics=dict(self.first_diagnostics),
        )


def drops_by_topic(
    drops: Mapping[type, Drops], channels: Mapping[type, Channel], anchor: Anchor
) -> dict[str, TopicDrops]:
    """Losses by topic in session time; two kinds of message can share a topic."""
    topics: dict[str, TopicDrops] = {}
    for kind, drop in drops.items():
        topic = channels[kind].topic
        first_ns, last_ns = anchor.session_ns(drop.first_ns), anchor.session_ns(drop.last_ns)
        other = topics.get(topic, TopicDrops(0, first_ns, last_ns))
        topics[topic] = TopicDrops(other.count + drop.count, min(other.first_ns, first_ns), max(other.last_ns, last_ns))
    return topics
