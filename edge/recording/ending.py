"""What closes an MCAP file: DataEnd, summary and footer, gathered while the data go by."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable
from io import BytesIO
from operator import itemgetter

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC as MAGIC

from edge.recording.chunk import ChunkHeader
from edge.recording.scan import packed

Index = dict[int, list[tuple[int, int]]]
"""Per channel id (log_time, offset in the chunk)."""


def message_indexes(index: Index) -> dict[int, bytes]:
    """The MessageIndex record of each channel of a chunk, packed."""
    return {channel: _message_index(channel, entries) for channel, entries in index.items()}


def _message_index(channel: int, entries: list[tuple[int, int]]) -> bytes:
    array = np.asarray(sorted(entries), dtype="<u8").tobytes()
    return struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + len(array), channel, len(array)) + array


class Ending:
    """Collects what the summary says about a file."""

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.counts: dict[int, int] = {}
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._attachments: list[AttachmentIndex] = []

    @property
    def chunk_count(self) -> int:
        return len(self._chunks)

    @property
    def message_count(self) -> int:
        return sum(self.counts.values())

    def defines(self, channel: int) -> bool:
        """Whether messages of this channel can be understood."""
        known = self.channels.get(channel)
        return known is not None and (known.schema_id == 0 or known.schema_id in self.schemas)

    def add_message(self, channel: int, log_time: int) -> None:
        self.counts[channel] = self.counts.get(channel, 0) + 1
        self._span(log_time, log_time)

    def add_chunk(
        self, offset: int, length: int, header: ChunkHeader, index: Index, indexes: Iterable[tuple[int, int]]
    ) -> None:
        """Count a chunk of `length` bytes, record head included. indexes: channel id and length of its indexes."""
        at = offset + length
        offsets: dict[int, int] = {}
        for channel, size in indexes:
            offsets.setdefault(channel, at)
            at += size
        times = [log_time for entries in index.values() for log_time, _ in entries]
        start_ns, end_ns = (min(times), max(times)) if times else (0, 0)
        for channel, entries in index.items():
            self.counts[channel] = self.counts.get(channel, 0) + len(entries)
        if times:
            self._span(start_ns, end_ns)
        self._chunks.append(
            ChunkIndex(
                message_start_time=start_ns,
                message_end_time=end_ns,
                chunk_start_offset=offset,
                chunk_length=length,
                message_index_offsets=offsets,
                message_index_length=at - offset - length,
                compression=header.compression,
                compressed_size=header.data_size,
                uncompressed_size=header.uncompressed_size,
            )
        )

    def add_metadata(self, offset: int, raw_length: int, metadata: Metadata) -> None:
        self._metadata.append(MetadataIndex(offset=offset, length=raw_length, name=metadata.name))

    def add_attachment(self, offset: int, raw_length: int, head: Attachment, data_size: int) -> None:
        self._attachments.append(
            AttachmentIndex(
                offset=offset,
                length=raw_length,
                log_time=head.log_time,
                create_time=head.create_time,
                data_size=data_size,
                name=head.name,
                media_type=head.media_type,
            )
        )

    def _span(self, start_ns: int, end_ns: int) -> None:
        self.first_ns = start_ns if self.first_ns is None else min(self.first_ns, start_ns)
        self.last_ns = end_ns if self.last_ns is None else max(self.last_ns, end_ns)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self.channels),
            channel_message_counts=dict(sorted(self.counts.items())),
            chunk_count=len(self._chunks),
            message_count=self.message_count,
            message_end_time=self.last_ns or 0,
            message_start_time=self.first_ns or 0,
            metadata_count=len(self._metadata),
            schema_count=len(self.schemas),
        )

    def pack(self, offset: int) -> bytes:
        """Everything from DataEnd to the last byte of a file whose data end at `offset`."""
        data_end = packed(DataEnd(0))
        start = offset + len(data_end)
        groups: list[tuple[Opcode, list[McapRecord]]] = [
            (Opcode.SCHEMA, [schema for _, schema in sorted(self.schemas.items(), key=itemgetter(0))]),
            (Opcode.CHANNEL, [channel for _, channel in sorted(self.channels.items(), key=itemgetter(0))]),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, list(self._chunks)),
            (Opcode.ATTACHMENT_INDEX, list(self._attachments)),
            (Opcode.METADATA_INDEX, list(self._metadata)),
        ]
        summary, offsets = bytearray(), bytearray()
        for opcode, records in groups:
            group = b"".join(map(packed, records))
            if group:
                offsets += packed(SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        offsets_start = start + len(summary)
        summary += offsets
        footer = packed(Footer(start, offsets_start, 0))[:-4]
        crc = zlib.crc32(footer, zlib.crc32(summary))
        return b"".join((data_end, summary, footer, crc.to_bytes(4, "little"), MAGIC))


def attachment_head(read: Callable[[int, int], bytes], content: int) -> tuple[Attachment, int]:
    """Times and names of an attachment whose content starts at `content`, without its data; and the data's size."""
    fixed = ReadDataStream(BytesIO(read(content, 16 + (1 << 16))))
    log_time, create_time = fixed.read8(), fixed.read8()
    name, media_type = fixed.read_prefixed_string(), fixed.read_prefixed_string()
    data_size = fixed.read8()
    return Attachment(create_time=create_time, log_time=log_time, name=name, media_type=media_type, data=b""), data_size
