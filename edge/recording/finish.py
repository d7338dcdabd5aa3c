"""Closing a file that a power cut left open, in place: nothing is copied, only the end is rewritten."""

from __future__ import annotations

import os
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from edge.errors import RecordingError
from edge.recording.chunk import ChunkDamaged, chunk_body, chunk_header, contents
from edge.recording.ending import Ending, attachment_head, message_indexes
from edge.recording.losses import Losses, Summary
from edge.recording.report import RecoverReport
from edge.recording.scan import HEADER_SIZE, PRIVATE, Record, RecordFile, parse
from edge.recording.survey import ChunkPiece, DamagePiece, EndPiece, LoosePiece, Piece, agrees, indexed, survey

_CHECKED_TAIL = 64 << 20
"""Bytes before the end in which checksums are tested: what was not yet on the disk when the power went is there."""


def finish_in_place(path: Path) -> RecoverReport:
    """Cut `path` after its last sound record and append indexes, summary and footer, then fsync.

    Damage with sound records after it becomes a private record, which readers skip. A file that was closed properly is
    left as it is. A repair that is itself cut off can be repeated. FormatError when nothing of a recording is in it.
    """
    with RecordFile(path, writable=True) as file:
        try:
            return _Finish(file).run()
        except OSError as error:
            raise RecordingError(f"{path}: cannot be finished: {error.strerror}; make room on the card") from error


class _Finish:
    def __init__(self, file: RecordFile) -> None:
        self._file = file
        self._summary = Summary(file)
        self._losses = Losses(file, self._summary)
        self._ending = Ending()
        self._closing = b""

    def run(self) -> RecoverReport:
        if self._file.header() is None:
            raise self._refusal("its beginning is damaged")
        *pieces, end = survey(self._file)
        sound = [piece for piece in pieces if self._is_sound(piece)]
        sound = [piece for piece in sound if self._count(piece, last=piece is sound[-1])]
        if not all(map(self._ending.defines, self._ending.counts)):
            raise self._refusal("the part that names its topics is lost")
        if isinstance(end, EndPiece):
            self._losses.end(end)
        if not self._summary.whole:
            self._close(pieces, sound)
        return self._losses.report(self._file.path, self._ending)

    def _refusal(self, why: str) -> RecordingError:
        return RecordingError(f"{self._file.path}: {why}; run `mapforest recover` on it, which writes a new file")

    def _is_sound(self, piece: Piece) -> bool:
        if isinstance(piece, DamagePiece):
            self._losses.span(piece)
            return False
        if not isinstance(piece, ChunkPiece) or piece.end < self._file.size - _CHECKED_TAIL or self._summary.whole:
            return True
        try:
            contents(chunk_body(self._file, chunk_header(self._file, piece.record)))
        except ChunkDamaged as damage:
            self._losses.chunk(piece, str(damage))
            return False
        return True

    def _count(self, piece: Piece, *, last: bool) -> bool:
        match piece:
            case ChunkPiece():
                return self._count_chunk(piece, rebuild=last and not self._summary.whole)
            case LoosePiece(record=record):
                self._count_loose(record)
        return True

    def _count_chunk(self, piece: ChunkPiece, *, rebuild: bool) -> bool:
        header = chunk_header(self._file, piece.record)
        index = indexed(self._file, piece.indexes)
        known = bool(self._ending.channels) and all(map(self._ending.defines, index))
        if rebuild or not index or not known or not agrees(index, header):
            try:
                found = contents(chunk_body(self._file, header))
            except ChunkDamaged as damage:
                self._losses.chunk(piece, str(damage))
                return False
            self._ending.schemas |= found.schemas
            self._ending.channels |= found.channels
            index = found.index
        sizes = [(channel_of(self._file, record), record.length + HEADER_SIZE) for record in piece.indexes]
        if rebuild:
            packed_indexes = message_indexes(index)
            self._closing = b"".join(packed_indexes.values())
            sizes = [(channel, len(data)) for channel, data in packed_indexes.items()]
        length = piece.record.length + HEADER_SIZE
        self._ending.add_chunk(piece.record.offset, length, header, index, sizes)
        return True

    def _count_loose(self, record: Record) -> None:
        raw_length = record.length + HEADER_SIZE
        if record.opcode == Opcode.MESSAGE:
            head = self._file.read(record.content, 14)
            self._ending.add_message(int.from_bytes(head[:2], "little"), int.from_bytes(head[6:], "little"))
        elif record.opcode == Opcode.ATTACHMENT:
            self._ending.add_attachment(record.offset, raw_length, *attachment_head(self._file.read, record.content))
        elif record.opcode in {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA}:
            self._count_definition(record, raw_length)

    def _count_definition(self, record: Record, raw_length: int) -> None:
        kinds = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel, Opcode.METADATA: Metadata}
        match parse(self._file, record, kinds[Opcode(record.opcode)]):
            case Schema() as schema:
                self._ending.schemas[schema.id] = schema
            case Channel() as channel:
                self._ending.channels[channel.id] = channel
            case Metadata() as metadata:
                self._ending.add_metadata(record.offset, raw_length, metadata)

    def _close(self, pieces: list[Piece], sound: list[Piece]) -> None:
        """The indexes of the last chunk are written anew: the cut may have come between them."""
        header = self._file.header()
        last = sound[-1] if sound else None
        keep_end = last.end if last else header.end if header else 0
        kept = set(sound)
        self._blank([_span(piece) for piece in pieces if piece not in kept and piece.end <= keep_end])
        at = last.record.end if isinstance(last, ChunkPiece) and self._closing else keep_end
        os.ftruncate(self._file.fd, at)
        closing = self._closing + self._ending.pack(at + len(self._closing))
        while closing:
            written = os.pwrite(self._file.fd, closing, at)
            closing, at = closing[written:], at + written
        os.fsync(self._file.fd)

    def _blank(self, spans: list[tuple[int, int]]) -> None:
        """Turn spans of bytes into private records."""
        if any(end - start < HEADER_SIZE for start, end in spans):
            raise self._refusal("a few bytes in it are damaged that no record fits into")
        for start, end in spans:
            os.pwrite(self._file.fd, bytes([PRIVATE]) + (end - start - HEADER_SIZE).to_bytes(8, "little"), start)


def _span(piece: Piece) -> tuple[int, int]:
    return (piece.record.offset if isinstance(piece, ChunkPiece | LoosePiece) else piece.offset), piece.end


def channel_of(file: RecordFile, index: Record) -> int:
    """The channel id a message index is about."""
    return int.from_bytes(file.read(index.content, 2), "little")
