"""What a file holds from front to back, whole or damaged, from the heads of its records."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC as MAGIC

from edge.errors import FormatError
from edge.recording.chunk import ChunkHeader
from edge.recording.scan import HEADER_SIZE, Record, RecordFile, plausible, resync


@dataclass(frozen=True, slots=True)
class ChunkPiece:
    """A chunk whose head is sound, and the message indexes that follow it."""

    record: Record
    indexes: tuple[Record, ...]

    @property
    def end(self) -> int:
        return self.indexes[-1].end if self.indexes else self.record.end


@dataclass(frozen=True, slots=True)
class LoosePiece:
    """Any other sound record outside chunks."""

    record: Record

    @property
    def end(self) -> int:
        return self.record.end


@dataclass(frozen=True, slots=True)
class DamagePiece:
    """Bytes that are no records, with sound ones after them. `indexes` tell what was in them, where they survived."""

    offset: int
    end: int
    indexes: tuple[Record, ...]


@dataclass(frozen=True, slots=True)
class EndPiece:
    """Where the data end. finished: the DataEnd record is there; otherwise `offset` to the file's end is torn."""

    offset: int
    finished: bool

    @property
    def end(self) -> int:
        return self.offset


Piece: TypeAlias = ChunkPiece | LoosePiece | DamagePiece | EndPiece


def survey(file: RecordFile) -> Iterator[Piece]:
    """Walk the data section. The last piece is always an EndPiece."""
    header = file.header()
    offset = header.end if header else 0
    if header is None:
        first = resync(file, 0)
        if first is None and MAGIC.startswith(file.read(0, len(MAGIC))):
            raise FormatError(f"{file.path} was cut off in its first {file.size} bytes, before anything was recorded")
        if first is None:
            raise FormatError(f"{file.path} is not an MCAP recording: neither its beginning nor a chunk is in it")
        _, offset = _indexes(file, first.offset)
        yield DamagePiece(0, offset, ())
    while True:
        record = file.record_at(offset)
        if record is None or not plausible(file, record):
            resumed = resync(file, offset + 1) if offset < file.size else None
            if resumed is None:
                yield EndPiece(offset, finished=False)
                return
            indexes, end = _indexes(file, resumed.offset)
            yield DamagePiece(offset, end, indexes)
        elif record.opcode == Opcode.DATA_END:
            yield EndPiece(offset, finished=True)
            return
        elif record.opcode == Opcode.CHUNK:
            indexes, end = _indexes(file, record.end)
            yield ChunkPiece(record, indexes)
        elif record.opcode == Opcode.MESSAGE_INDEX:  # without its chunk
            indexes, end = _indexes(file, offset)
            yield DamagePiece(offset, end, indexes)
        else:
            yield LoosePiece(record)
            end = record.end
        offset = end


def _indexes(file: RecordFile, offset: int) -> tuple[tuple[Record, ...], int]:
    """The message indexes that start at `offset`, and where they end."""
    found: list[Record] = []
    while True:
        record = file.record_at(offset)
        if record is None or record.opcode != Opcode.MESSAGE_INDEX or not plausible(file, record):
            return tuple(found), offset
        found.append(record)
        offset = record.end


def agrees(index: dict[int, list[tuple[int, int]]], header: ChunkHeader) -> bool:
    """Whether message indexes, which have no checksum, can be those of a chunk with this header."""
    return all(
        header.start_ns <= log_time <= header.end_ns and offset < header.uncompressed_size
        for entries in index.values()
        for log_time, offset in entries
    )


def indexed(file: RecordFile, indexes: tuple[Record, ...]) -> dict[int, list[tuple[int, int]]]:
    """Per channel id (log_time, offset in the chunk) as message indexes tell it."""
    if not indexes:
        return {}
    start = indexes[0].offset
    block = file.read(start, indexes[-1].end - start)
    found: dict[int, list[tuple[int, int]]] = {}
    for record in indexes:
        at = record.offset - start + HEADER_SIZE
        channel = int.from_bytes(block[at : at + 2], "little")
        entries = struct.iter_unpack("<QQ", block[at + 6 : at + record.length])
        found.setdefault(channel, []).extend((log_time, offset) for log_time, offset in entries)
    return found
