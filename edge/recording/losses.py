"""Book-keeping of damaged places during a repair."""

from __future__ import annotations

from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, McapRecord, Schema, Statistics

from edge.recording.chunk import ChunkDamaged, chunk_header
from edge.recording.ending import Ending, Index
from edge.recording.report import Damage, RecoverReport
from edge.recording.scan import HEADER_SIZE, Record, RecordFile, parse
from edge.recording.survey import ChunkPiece, DamagePiece, EndPiece, indexed

_SUMMARY_KINDS: dict[int, type[McapRecord]] = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.STATISTICS: Statistics,
}


class Summary:
    """What the file's own summary tells, where it survived."""

    def __init__(self, file: RecordFile) -> None:
        self.whole = file.footer() is not None
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.counts: dict[int, int] = {}
        self.last_ns: int | None = None
        for record in file.summary():
            self._take(file, record)

    def _take(self, file: RecordFile, record: Record) -> None:
        kind = _SUMMARY_KINDS.get(record.opcode)
        parsed = parse(file, record, kind) if kind else None
        if isinstance(parsed, Schema):
            self.schemas[parsed.id] = parsed
        elif isinstance(parsed, Channel):
            self.channels[parsed.id] = parsed
        elif isinstance(parsed, Statistics):
            self.counts = parsed.channel_message_counts
            self.last_ns = parsed.message_end_time if parsed.message_count else None


class Losses:
    """Damaged places of one file as they are met."""

    def __init__(self, file: RecordFile, summary: Summary) -> None:
        self._file = file
        self._summary = summary
        self._places: list[tuple[int, int, str, Index]] = []
        self._tail_ns: int | None = summary.last_ns
        self._dropped = 0

    def chunk(self, piece: ChunkPiece, reason: str) -> None:
        self._add(piece.record.offset, piece.end, f"are a damaged chunk ({reason})", indexed(self._file, piece.indexes))

    def span(self, piece: DamagePiece) -> None:
        self._add(piece.offset, piece.end, "are no readable records", indexed(self._file, piece.indexes))

    def unknown(self, piece: ChunkPiece, index: Index) -> None:
        """Messages whose topic was defined in a part that is lost."""
        self._add(piece.record.offset, piece.record.offset, "held messages whose topic is no longer known", index)

    def end(self, piece: EndPiece) -> None:
        """Note what a torn end was, unless it was only an index or nothing at all."""
        torn = self._file.size - piece.offset
        if piece.finished or torn <= 0:
            return
        head = self._file.read(piece.offset, HEADER_SIZE)
        if head[0] == Opcode.MESSAGE_INDEX:
            return
        if head[0] == Opcode.CHUNK and torn > HEADER_SIZE + 16:
            self._torn_chunk(piece.offset)
        self._add(piece.offset, self._file.size, "at the end are cut off or empty", {})

    def _torn_chunk(self, offset: int) -> None:
        try:
            header = chunk_header(self._file, Record(Opcode.CHUNK, offset, 0))
        except ChunkDamaged:
            return
        self._tail_ns = header.end_ns

    def _add(self, start: int, end: int, reason: str, index: Index) -> None:
        self._dropped += end - start
        self._places.append((start, end - start, reason, index))

    def report(self, target: Path, ending: Ending) -> RecoverReport:
        """Put it all in terms of topics."""

        def named(counts: dict[int, int]) -> dict[str, int]:
            found: dict[str, int] = {}
            for channel, count in counts.items():
                definition = ending.channels.get(channel) or self._summary.channels.get(channel)
                topic = definition.topic if definition else f"(unknown topic {channel})"
                found[topic] = found.get(topic, 0) + count
            return found

        kept = dict.fromkeys((channel.topic for channel in ending.channels.values()), 0) | named(ending.counts)
        return RecoverReport(
            source=str(self._file.path),
            target=str(target),
            complete=self._summary.whole,
            topics=dict(sorted(kept.items())),
            chunks=ending.chunk_count,
            bytes_dropped=self._dropped,
            first_ns=ending.first_ns,
            last_ns=ending.last_ns,
            lost_tail_s=self._lost_tail_s(ending),
            damages=tuple(
                Damage(offset, size, reason, named({c: len(e) for c, e in index.items()}), *_span(index))
                for offset, size, reason, index in self._places
            ),
            lost_messages=named(self._lost(ending)),
        )

    def _lost(self, ending: Ending) -> dict[int, int]:
        if self._summary.counts:
            missing = {c: count - ending.counts.get(c, 0) for c, count in self._summary.counts.items()}
            return {channel: count for channel, count in missing.items() if count > 0}
        lost: dict[int, int] = {}
        for _, _, _, index in self._places:
            for channel, entries in index.items():
                lost[channel] = lost.get(channel, 0) + len(entries)
        return lost

    def _lost_tail_s(self, ending: Ending) -> float | None:
        if not self._places or self._tail_ns is None or ending.last_ns is None or self._tail_ns < ending.last_ns:
            return None
        return (self._tail_ns - ending.last_ns) / 1e9


def _span(index: Index) -> tuple[int | None, int | None]:
    times = [log_time for entries in index.values() for log_time, _ in entries]
    return (min(times), max(times)) if times else (None, None)
