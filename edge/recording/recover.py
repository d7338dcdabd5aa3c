"""Repair of recordings that were cut off or damaged.

`recover` copies everything sound into a new file and never touches its input. `finish_in_place` closes what a power
cut left of the recorder's own files, without copying.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema
from mcap.writer import MCAP0_MAGIC as MAGIC

from edge.errors import RecordingError
from edge.recording.chunk import (
    ChunkDamaged,
    ChunkHeader,
    Contents,
    chunk_body,
    chunk_header,
    contents,
    packed_chunk,
    without,
)
from edge.recording.ending import Ending, Index, attachment_head, message_indexes
from edge.recording.finish import finish_in_place
from edge.recording.losses import Losses, Summary
from edge.recording.report import Damage, RecoverReport
from edge.recording.scan import HEADER_SIZE, Record, RecordFile, packed, parse
from edge.recording.survey import ChunkPiece, DamagePiece, EndPiece, LoosePiece, survey

__all__ = ["Damage", "RecoverReport", "finish_in_place", "recover"]

_BLOCK = 4 << 20
_LOOSE_CHUNK = 1 << 20


Progress = Callable[[int, int], None]
"""Called with bytes done and bytes in all."""


def recover(source: Path, target: Path, progress: Progress | None = None) -> RecoverReport:
    """Copy every sound chunk of `source` into the new file `target`, and say what was lost.

    Memory is bounded by the largest chunk. FormatError when `source` holds nothing of a recording, RecordingError
    when `target` exists or cannot be written; nothing is left behind then.
    """
    with RecordFile(source) as file:
        _refuse_existing(source, target)
        try:
            return _into(file, target, progress)
        except OSError as error:
            raise RecordingError(
                f"{target}: cannot be written: {error.strerror or error}; choose a folder with room, "
                f"about {file.size >> 20} MiB"
            ) from error


def _refuse_existing(source: Path, target: Path) -> None:
    if target.exists() and target.samefile(source):
        raise RecordingError(f"{target} is the damaged file itself; name another file to recover into")
    if target.exists():
        raise RecordingError(f"{target} exists already; name another file to recover into, or move it away")


def _into(file: RecordFile, target: Path, progress: Progress | None) -> RecoverReport:
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    part = Path(name)
    try:
        with os.fdopen(handle, "wb") as sink:
            report = Copy(file, sink).run(target, progress)
            sink.flush()
            os.fsync(sink.fileno())
        shutil.copymode(file.path, part)
        part.rename(target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    return report


class Copy:
    """One file being copied into another, piece by piece."""

    def __init__(self, file: RecordFile, sink: BinaryIO) -> None:
        self._file = file
        self._sink = sink
        self._at = 0
        self._summary = Summary(file)
        self._losses = Losses(file, self._summary)
        self._ending = Ending()
        self._loose = bytearray()

    def run(self, target: Path, progress: Progress | None = None) -> RecoverReport:
        """Copy everything sound and close the file."""
        pieces = survey(self._file)
        piece = next(pieces)  # raises before anything is written when this is no recording
        self._write(MAGIC + self._header())
        while not isinstance(piece, EndPiece):
            match piece:
                case ChunkPiece():
                    self._chunk(piece)
                case LoosePiece():
                    self._loose_record(piece.record)
                case DamagePiece():
                    self._losses.span(piece)
            if progress is not None:
                progress(piece.end, self._file.size)
            piece = next(pieces)
        self._losses.end(piece)
        self._flush_loose()
        self._write(self._ending.pack(self._at))
        return self._losses.report(target, self._ending)

    def _write(self, data: bytes) -> None:
        self._sink.write(data)
        self._at += len(data)

    def _header(self) -> bytes:
        header = self._file.header()
        if header is not None:
            return self._file.raw(header)
        foreign = any(not schema.encoding.startswith("ros2") for schema in self._summary.schemas.values())
        return packed(Header(profile="" if foreign else "ros2", library="mapforest recover"))

    def _chunk(self, piece: ChunkPiece) -> None:
        self._flush_loose()
        try:
            header = chunk_header(self._file, piece.record)
            body = chunk_body(self._file, header)
            found = contents(body)
        except ChunkDamaged as damage:
            self._losses.chunk(piece, str(damage))
            return
        self._learn(found)
        unknown = {channel for channel in found.index if not self._ending.defines(channel)}
        if not unknown:
            self._append_chunk(self._file.raw(piece.record), header, found.index)
            return
        self._losses.unknown(piece, {channel: found.index[channel] for channel in unknown})
        self._append_body(without(body, unknown))

    def _learn(self, found: Contents) -> None:
        """Take up the chunk's definitions; write those that only the summary still knows."""
        self._ending.schemas |= found.schemas
        self._ending.channels |= found.channels
        for channel_id in found.index:
            channel = self._summary.channels.get(channel_id)
            if self._ending.defines(channel_id) or channel is None:
                continue
            schema = self._summary.schemas.get(channel.schema_id)
            if schema is not None:
                self._ending.schemas[schema.id] = schema
                self._write(packed(schema))
            self._ending.channels[channel.id] = channel
            self._write(packed(channel))

    def _append_body(self, body: bytes) -> None:
        found = contents(body)
        if body:
            raw, header = packed_chunk(body, found.index)
            self._append_chunk(raw, header, found.index)

    def _append_chunk(self, raw: bytes, header: ChunkHeader, index: Index) -> None:
        indexes = message_indexes(index)
        self._ending.add_chunk(self._at, len(raw), header, index, [(c, len(data)) for c, data in indexes.items()])
        self._write(raw)
        self._write(b"".join(indexes.values()))

    def _loose_record(self, record: Record) -> None:
        if record.opcode == Opcode.MESSAGE:
            self._loose_message(record)
            return
        self._flush_loose()
        start = self._at
        self._define(record)
        for offset in range(record.offset, record.end, _BLOCK):
            self._write(self._file.read(offset, min(_BLOCK, record.end - offset)))
        if record.opcode == Opcode.METADATA:
            metadata = parse(self._file, record, Metadata)
            if isinstance(metadata, Metadata):
                self._ending.add_metadata(start, record.length + HEADER_SIZE, metadata)
        elif record.opcode == Opcode.ATTACHMENT:
            head, size = attachment_head(self._file.read, record.content)
            self._ending.add_attachment(start, record.length + HEADER_SIZE, head, size)

    def _define(self, record: Record) -> None:
        kind = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel}.get(record.opcode)  # type: ignore[call-overload]
        definition = parse(self._file, record, kind) if kind else None
        if isinstance(definition, Schema):
            self._ending.schemas[definition.id] = definition
        elif isinstance(definition, Channel):
            self._ending.channels[definition.id] = definition

    def _loose_message(self, record: Record) -> None:
        """Messages outside chunks are gathered into chunks, so that the copy has an index."""
        raw = self._file.raw(record)
        channel = int.from_bytes(raw[HEADER_SIZE : HEADER_SIZE + 2], "little")
        if not self._ending.defines(channel):
            self._losses.span(DamagePiece(record.offset, record.end, ()))
            return
        self._loose += raw
        if len(self._loose) >= _LOOSE_CHUNK:
            self._flush_loose()

    def _flush_loose(self) -> None:
        body = bytes(self._loose)
        self._loose.clear()
        self._append_body(body)
