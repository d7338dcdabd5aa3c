"""One chunk of an MCAP file: its header, its checked content, what is inside."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from io import BytesIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from edge.recording.scan import HEADER_SIZE, Record, RecordFile

SIZE_LIMIT = 2 << 30
"""A chunk that claims to be larger is damaged, or was never meant to be read at once."""
_FIXED = struct.Struct("<QQQII")
_RECORD_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")


class ChunkDamaged(Exception):
    """The content of a chunk is not what was written. The text says how that shows."""


@dataclass(frozen=True, slots=True)
class ChunkHeader:
    """What stands before the content. start_ns, end_ns: least and largest log time. data_offset: in the file."""

    start_ns: int
    end_ns: int
    uncompressed_size: int
    crc: int
    compression: str
    data_offset: int
    data_size: int


@dataclass(slots=True)
class Contents:
    """What a chunk holds. index: per channel id (log_time, offset in the content) of each message."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    index: dict[int, list[tuple[int, int]]] = field(default_factory=dict)


def chunk_header(file: RecordFile, record: Record) -> ChunkHeader:
    """The header of a chunk, also of a torn one. ChunkDamaged when not even that is there."""
    head = file.read(record.content, _FIXED.size + 4 + 8)
    if len(head) < _FIXED.size:
        raise ChunkDamaged("cut off within its header")
    start_ns, end_ns, size, crc, name_length = _FIXED.unpack_from(head)
    name = head[_FIXED.size : _FIXED.size + name_length]
    stored = int.from_bytes(head[_FIXED.size + len(name) : _FIXED.size + len(name) + 8], "little")
    data_offset = record.content + _FIXED.size + name_length + 8
    return ChunkHeader(start_ns, end_ns, size, crc, name.decode("ascii", "replace"), data_offset, stored)


def chunk_body(file: RecordFile, header: ChunkHeader) -> bytes:
    """The content, decompressed and checked. ChunkDamaged when it is not what was written."""
    if max(header.uncompressed_size, header.data_size) > SIZE_LIMIT:
        raise ChunkDamaged(f"claims {header.uncompressed_size} bytes")
    body = _decompress(header, file.read(header.data_offset, header.data_size))
    if len(body) != header.uncompressed_size:
        raise ChunkDamaged(f"holds {len(body)} bytes instead of {header.uncompressed_size}")
    if header.crc and zlib.crc32(body) != header.crc:
        raise ChunkDamaged("checksum is wrong")
    return body


def _decompress(header: ChunkHeader, data: bytes) -> bytes:
    try:
        if header.compression == "lz4":
            content: bytes = lz4.frame.decompress(data)
            return content
        if header.compression == "zstd":
            return zstandard.ZstdDecompressor().decompress(data, max_output_size=header.uncompressed_size)
    except (RuntimeError, zstandard.ZstdError, MemoryError) as error:
        raise ChunkDamaged(f"cannot be decompressed ({error})") from error
    return data


def contents(body: bytes) -> Contents:
    """Walk the records of a chunk. ChunkDamaged when they do not end where the chunk ends."""
    found = Contents()
    offset, end = 0, len(body)
    while offset < end:
        if offset + HEADER_SIZE > end:
            raise ChunkDamaged("a record in it is cut off")
        opcode, length = _RECORD_HEAD.unpack_from(body, offset)
        following = offset + HEADER_SIZE + length
        if following > end:
            raise ChunkDamaged("a record in it runs over its end")
        if opcode == Opcode.MESSAGE:
            if length < _MESSAGE_HEAD.size:
                raise ChunkDamaged("a message in it is too short")
            channel, _, log_time, _ = _MESSAGE_HEAD.unpack_from(body, offset + HEADER_SIZE)
            found.index.setdefault(channel, []).append((log_time, offset))
        elif opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            _define(found, opcode, body[offset + HEADER_SIZE : following])
        offset = following
    return found


def _define(found: Contents, opcode: int, content: bytes) -> None:
    stream = ReadDataStream(BytesIO(content))
    try:
        if opcode == Opcode.SCHEMA:
            schema: Schema = Schema.read(stream)
            found.schemas[schema.id] = schema
        else:
            channel: Channel = Channel.read(stream)
            found.channels[channel.id] = channel
    except (struct.error, EndOfFile, UnicodeDecodeError) as error:
        raise ChunkDamaged("a topic definition in it cannot be read") from error


def without(body: bytes, unknown: set[int]) -> bytes:
    """The content less the messages of some channels."""
    kept: list[bytes] = []
    offset = 0
    while offset < len(body):
        opcode, length = _RECORD_HEAD.unpack_from(body, offset)
        following = offset + HEADER_SIZE + length
        if opcode != Opcode.MESSAGE or _MESSAGE_HEAD.unpack_from(body, offset + HEADER_SIZE)[0] not in unknown:
            kept.append(body[offset:following])
        offset = following
    return b"".join(kept)


def packed_chunk(body: bytes, index: dict[int, list[tuple[int, int]]]) -> tuple[bytes, ChunkHeader]:
    """An uncompressed chunk record around records, and its header (data_offset counts from the record)."""
    times = [log_time for entries in index.values() for log_time, _ in entries] or [0]
    crc = zlib.crc32(body)
    fixed = _FIXED.pack(min(times), max(times), len(body), crc, 0) + len(body).to_bytes(8, "little")
    head = _RECORD_HEAD.pack(Opcode.CHUNK, len(fixed) + len(body)) + fixed
    return head + body, ChunkHeader(min(times), max(times), len(body), crc, "", len(head), len(body))
