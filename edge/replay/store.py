"""The raw messages of some topics, over all files of a recording, in order of log time.

The order comes from the message indexes (20 bytes a message in memory); contents are read chunk by chunk through a
cache bounded in bytes, so chunks that overlap in time, as every recorder writes them, are read once.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from edge.recording.chunk import ChunkDamaged, chunk_body, chunk_header
from edge.recording.scan import HEADER_SIZE, RecordFile
from edge.validation.index import FileIndex, Topic
from edge.validation.recording import Recording

CACHE_BYTES = 48 << 20
_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_LOOSE = -1
"""Chunk ordinal of messages that stand outside chunks: their offset is in the file."""


@dataclass(frozen=True, slots=True)
class Raw:
    """One message as written. data: CDR, a view that keeps its chunk in memory."""

    topic: str
    log_ns: int
    publish_ns: int
    data: memoryview


@dataclass(frozen=True, slots=True)
class _Order:
    """(n,) arrays: where each message lies, sorted by log time."""

    times_ns: npt.NDArray[np.int64]
    topic: npt.NDArray[np.int16]
    file: npt.NDArray[np.int16]
    chunk: npt.NDArray[np.int32]
    offset: npt.NDArray[np.int64]


class MessageStore:
    """The index of a recording. FormatError when there is nothing to index."""

    def __init__(self, targets: Sequence[Path]) -> None:
        self.recording = Recording.read(targets)
        self.files: list[FileIndex] = self.recording.files
        self.damages: list[str] = [*self.recording.unreadable.values(), *(d for f in self.files for d in f.damages)]
        """What could not be read, in words; grows while messages are read."""

    @property
    def topics(self) -> dict[str, Topic]:
        """By name."""
        return self.recording.topics

    def count(self, topic: str) -> int:
        """Messages on a topic."""
        return len(self.recording.times.get(topic, ()))

    def times_ns(self, topic: str) -> npt.NDArray[np.int64]:
        """(n,) log times, in file order."""
        return self.recording.times.get(topic, np.empty(0, np.int64))

    def messages(self, topics: Collection[str]) -> Iterator[Raw]:
        """Every message of these topics in order of log time; equal times in file order."""
        names = sorted(topics)
        order = self._order(names)
        yield from self._read(names, order, range(len(order.times_ns)))

    def some(self, topic: str, ordinals: Collection[int]) -> Iterator[Raw]:
        """A few messages of one topic by their place in time; places beyond the end are left out."""
        order = self._order([topic])
        yield from self._read([topic], order, sorted(o for o in ordinals if o < len(order.times_ns)))

    def _order(self, names: Sequence[str]) -> _Order:
        parts = [
            (np.full(len(series.times_ns), topic, np.int16), np.full(len(series.times_ns), file, np.int16), series)
            for file, index in enumerate(self.files)
            for topic, name in enumerate(names)
            if (series := index.series.get(name)) is not None
        ]
        if not parts:
            empty = np.empty(0, np.int64)
            return _Order(empty, empty.astype(np.int16), empty.astype(np.int16), empty.astype(np.int32), empty)
        times = np.concatenate([series.times_ns for _, _, series in parts])
        chunk = np.concatenate([series.chunk for _, _, series in parts])
        offset = np.concatenate([series.offsets for _, _, series in parts])
        topic, file = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
        by = np.lexsort((offset, chunk, file, times))
        return _Order(times[by], topic[by], file[by], chunk[by], offset[by])

    def _read(self, names: Sequence[str], order: _Order, places: Sequence[int]) -> Iterator[Raw]:
        with ExitStack() as opened:
            cache = _Chunks(self.files, self.damages, opened)
            for place in places:
                body, at = cache.find(int(order.file[place]), int(order.chunk[place]), int(order.offset[place]))
                if body is None:
                    continue
                _, length = _HEAD.unpack_from(body, at)
                at += HEADER_SIZE
                _, _, log_ns, publish_ns = _MESSAGE.unpack_from(body, at)
                data = memoryview(body)[at + _MESSAGE.size : at + length]
                yield Raw(names[order.topic[place]], log_ns, publish_ns, data)


class _Chunks:
    """Contents of chunks, the most recently used kept."""

    def __init__(self, files: Sequence[FileIndex], damages: list[str], opened: ExitStack) -> None:
        self._files = files
        self._damages = damages
        self._opened = opened
        self._handles: dict[int, RecordFile] = {}
        self._bodies: OrderedDict[tuple[int, int], bytes | None] = OrderedDict()
        self._bytes = 0

    def find(self, file: int, chunk: int, offset: int) -> tuple[bytes | None, int]:
        """The bytes a message record lies in, and where in them; None where the chunk is damaged."""
        if chunk == _LOOSE:
            handle = self._handle(file)
            record = handle.record_at(offset)
            return (handle.raw(record), 0) if record is not None else (None, 0)
        key = (file, chunk)
        if key not in self._bodies:
            self._bodies[key] = body = self._load(file, chunk)
            self._bytes += len(body or b"")
            while self._bytes > CACHE_BYTES and len(self._bodies) > 1:
                self._bytes -= len(self._bodies.popitem(last=False)[1] or b"")
        self._bodies.move_to_end(key)
        return self._bodies[key], offset

    def _load(self, file: int, chunk: int) -> bytes | None:
        handle, record = self._handle(file), self._files[file].chunks[chunk]
        try:
            return chunk_body(handle, chunk_header(handle, record))
        except ChunkDamaged as damage:
            self._damages.append(f"{self._files[file].path.name}: a chunk at byte {record.offset:,} {damage}")
            return None

    def _handle(self, file: int) -> RecordFile:
        if file not in self._handles:
            self._handles[file] = self._opened.enter_context(RecordFile(self._files[file].path))
        return self._handles[file]
