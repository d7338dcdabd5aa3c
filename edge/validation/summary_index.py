"""Index of a closed file: everything is in its summary, and in the message indexes that it points to."""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from edge.recording.scan import HEADER_SIZE, Record, RecordFile, parse
from edge.validation.series import ENTRY_SIZE, FileIndex, Gather

_HEAD = struct.Struct("<BQ")
_CHUNK_INDEX = struct.Struct("<QQQQI")


class SummaryIndex(Gather):
    """A closed file: everything is in its summary and in the message indexes that it points to."""

    def __init__(self, file: RecordFile, index: FileIndex) -> None:
        super().__init__(file, index)
        self._spans: list[tuple[Record, int]] = []
        self._bounds: list[tuple[int, int, int]] = []

    def read(self) -> bool:
        """False when the summary does not lead to every message; the file has to be walked then."""
        footer = self.file.footer()
        if footer is None or not footer.summary_start:
            return False
        try:
            messages = self._read_summary(footer.summary_start)
        except struct.error:
            messages = None
        if messages is None or messages != self._read_indexes() or not self.agree(self._bound_array()):
            self.index.chunks.clear()
            self.index.compressions.clear()
            return False
        self.finish()
        return True

    def _bound_array(self) -> npt.NDArray[np.uint64]:
        return np.array(self._bounds, dtype=np.uint64).reshape(-1, 3)

    def _read_summary(self, start: int) -> int | None:
        """Returns the number of messages by the statistics."""
        messages: int | None = None
        block = self.file.read(start, self.file.size - start)
        at = 0
        while at + HEADER_SIZE <= len(block) and block[at] != Opcode.FOOTER:
            opcode, length = _HEAD.unpack_from(block, at)
            if opcode == Opcode.CHUNK_INDEX:
                self._add_chunk(block, at + HEADER_SIZE)
            elif opcode == Opcode.STATISTICS:
                messages = int.from_bytes(block[at + HEADER_SIZE : at + HEADER_SIZE + 8], "little")
            elif opcode == Opcode.ATTACHMENT_INDEX:
                self.index.attachments += 1
            else:
                self._define(Record(opcode, start + at, length))
            at += HEADER_SIZE + length
        return messages

    def _add_chunk(self, block: bytes, at: int) -> None:
        start_ns, end_ns, offset, length, map_length = _CHUNK_INDEX.unpack_from(block, at)
        at += _CHUNK_INDEX.size + map_length
        index_length, name_length = struct.unpack_from("<QI", block, at)
        name = block[at + 12 : at + 12 + name_length].decode("ascii", "replace")
        (size,) = struct.unpack_from("<Q", block, at + 12 + name_length + 8)
        record = Record(Opcode.CHUNK, offset, length - HEADER_SIZE)
        self._spans.append((record, index_length))
        self._bounds.append((start_ns, end_ns, size))
        self.count_chunk(record, name)

    def _define(self, record: Record) -> None:
        if record.opcode == Opcode.METADATA_INDEX:
            offset = int.from_bytes(self.file.read(record.content, 8), "little")
            at = self.file.record_at(offset)
            metadata = parse(self.file, at, Metadata) if at else None
            if isinstance(metadata, Metadata):
                self.add_metadata(metadata)
        elif record.opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            parsed = parse(self.file, record, Schema if record.opcode == Opcode.SCHEMA else Channel)
            if isinstance(parsed, Schema):
                self.schemas[parsed.id] = parsed
            elif isinstance(parsed, Channel):
                self.channels[parsed.id] = parsed

    def _read_indexes(self) -> int:
        """Returns the number of messages they tell of."""
        counted = 0
        self.file.read_scattered()
        self.file.expect(
            (record.end, length) for record, length in self._spans if length and record.end < self.file.size
        )
        for ordinal, (record, length) in enumerate(self._spans):
            block = self.file.read(record.end, length)
            at = 0
            while at + HEADER_SIZE + 6 <= len(block) and block[at] == Opcode.MESSAGE_INDEX:
                size = int.from_bytes(block[at + 1 : at + 9], "little")
                entries = block[at + 15 : at + 9 + size]
                entries = entries[: len(entries) // ENTRY_SIZE * ENTRY_SIZE]
                self.add_entries(int.from_bytes(block[at + 9 : at + 11], "little"), entries, ordinal)
                counted += len(entries) // ENTRY_SIZE
                at += HEADER_SIZE + size
        return counted
