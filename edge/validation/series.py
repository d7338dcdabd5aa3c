"""Topics and message times of a file, and how they are put together from its records."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mcap.records import Channel, Metadata, Schema

from edge.recording.chunk import Contents
from edge.recording.scan import Record, RecordFile

_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])
ENTRY_SIZE = _ENTRY.itemsize
_LATEST_NS = np.uint64(1 << 62)
"""Nothing is later (the year 2116); damaged times stay where differences cannot overflow."""


@dataclass(frozen=True, slots=True)
class Series:
    """The messages of one topic in file order.

    times_ns: (n,) int64 log times. chunk: (n,) int32 ordinal of the chunk. offsets: (n,) int64 in the chunk's content;
    outside chunks the ordinal is -1 and the offset that of the record in the file.
    """

    times_ns: npt.NDArray[np.int64]
    chunk: npt.NDArray[np.int32]
    offsets: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic as its channel and schema describe it."""

    name: str
    type_name: str
    encoding: str


@dataclass(slots=True)
class FileIndex:
    """Everything known about a file without reading messages."""

    path: Path
    size: int
    finished: bool
    profile: str = ""
    library: str = ""
    topics: dict[str, Topic] = field(default_factory=dict)
    series: dict[str, Series] = field(default_factory=dict)
    chunks: list[Record] = field(default_factory=list)
    compressions: Counter[str] = field(default_factory=Counter)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    damages: list[str] = field(default_factory=list)
    attachments: int = 0

    @property
    def compression(self) -> str:
        """As a person would say it: "lz4", "none", "none and zstd"."""
        return " and ".join(sorted(name or "none" for name in self.compressions)) or "no chunks"


class Gather:
    """Definitions and index entries by channel id, until they can be told by topic."""

    def __init__(self, file: RecordFile, index: FileIndex) -> None:
        self.file = file
        self.index = index
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._blocks: dict[int, list[bytes]] = {}
        self._runs: dict[int, list[tuple[int, int]]] = {}

    def add_entries(self, channel: int, entries: bytes, chunk: int) -> None:
        """Index entries (log_time, offset) of a channel in the chunk with this ordinal, as they stand in the file."""
        if entries:
            self._blocks.setdefault(channel, []).append(entries)
            self._runs.setdefault(channel, []).append((chunk, len(entries) // ENTRY_SIZE))

    def add_contents(self, found: Contents, chunk: int) -> None:
        self.schemas |= found.schemas
        self.channels |= found.channels
        for channel, entries in found.index.items():
            self.add_entries(channel, np.asarray(entries, "<u8").tobytes(), chunk)

    def add_metadata(self, metadata: Metadata) -> None:
        self.index.metadata[metadata.name] = dict(metadata.metadata)

    def count_chunk(self, record: Record, compression: str) -> int:
        self.index.chunks.append(record)
        self.index.compressions[compression] += 1
        return len(self.index.chunks) - 1

    def finish(self) -> None:
        """Put channels into words and entries into arrays. Two channels of one topic are merged."""
        for channel in self.channels.values():
            schema = self.schemas.get(channel.schema_id)
            topic = Topic(channel.topic, schema.name if schema else "", channel.message_encoding)
            self.index.topics.setdefault(channel.topic, topic)
        by_topic: dict[str, list[int]] = {}
        for channel_id in self._blocks:
            known = self.channels.get(channel_id)
            name = known.topic if known else f"(unknown topic {channel_id})"
            by_topic.setdefault(name, []).append(channel_id)
        for name, ids in by_topic.items():
            self.index.topics.setdefault(name, Topic(name, "", ""))
            self.index.series[name] = self._series(ids)

    def _series(self, ids: list[int]) -> Series:
        entries = np.frombuffer(b"".join(block for i in ids for block in self._blocks[i]), _ENTRY)
        chunk = _ordinals([run for i in ids for run in self._runs[i]]).astype(np.int32)
        times = np.minimum(entries["time"], _LATEST_NS).astype(np.int64)
        offsets = np.minimum(entries["offset"], _LATEST_NS).astype(np.int64)
        # Within a chunk indexes may be sorted by time; file order is that of the offsets.
        order = (
            np.lexsort((offsets, chunk)) if len(ids) > 1 or np.any(np.diff(offsets)[np.diff(chunk) == 0] < 0) else ...
        )
        return Series(times[order], chunk[order], offsets[order])

    def agree(self, bounds: npt.NDArray[np.uint64]) -> bool:
        """Whether all entries can be true. bounds: (chunks, 3) first and last log time and content size of each chunk.

        Message indexes have no checksum; the bounds come from the summary, which has one.
        """
        for channel, blocks in self._blocks.items():
            entries = np.frombuffer(b"".join(blocks), _ENTRY)
            start, end, size = bounds[_ordinals(self._runs[channel])].T
            times = entries["time"]
            if np.any(times < start) or np.any(times > end) or np.any(entries["offset"] >= size):
                return False
        return True


def _ordinals(runs: list[tuple[int, int]]) -> npt.NDArray[np.int64]:
    """(chunk, count) pairs -> (n,) the chunk of each entry."""
    pairs = np.array(runs, dtype=np.int64).reshape(-1, 2)
    return np.repeat(pairs[:, 0], pairs[:, 1])
