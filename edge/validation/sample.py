"""A bounded sample of messages: their measurement stamps and sequence numbers.

Runs of consecutive chunks, spread over the file, first and last included, are read and checked. So an hour costs as
little as a minute, and a stamp that goes backwards now and then is found only where the sample looks.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from edge.recording.chunk import ChunkDamaged, chunk_body, chunk_header
from edge.recording.scan import HEADER_SIZE, RecordFile
from edge.validation.index import FileIndex

RUNS = 12
RUN_CHUNKS = 4
_SIZE_LIMIT = 96 << 20
"""Bytes of chunks read at most per recording."""
_MESSAGE = struct.Struct("<HIQQ")
_LATEST_NS = 1 << 62
_STAMPED_PREFIXES = ("sensor_msgs/msg/", "nav_msgs/msg/Odometry", "nmea_msgs/msg/Sentence")
_STAMPED_ENDINGS = ("/CustomMsg", "/CompressedVideo", "Stamped")


@dataclass(slots=True)
class Heads:
    """Consecutive messages of a topic. stamp_ns: header.stamp where the type has one, else publish time."""

    log_ns: list[int] = field(default_factory=list)
    stamp_ns: list[int] = field(default_factory=list)
    sequence: list[int] = field(default_factory=list)


@dataclass(slots=True)
class Sample:
    """runs: per run of consecutive chunks the heads by topic. damages: chunks whose checksum is wrong."""

    runs: list[dict[str, Heads]] = field(default_factory=list)
    damages: list[str] = field(default_factory=list)
    bodies: int = 0

    def stamps(self, topic: str) -> list[npt.NDArray[np.int64]]:
        """(n,) int64 arrays of consecutive stamps."""
        return [np.array(run[topic].stamp_ns, dtype=np.int64) for run in self.runs if topic in run]

    def latencies_s(self, topic: str) -> npt.NDArray[np.float64]:
        """(n,) log time minus stamp of every sampled message."""
        pairs = [(run[topic].log_ns, run[topic].stamp_ns) for run in self.runs if topic in run]
        parts = [
            np.subtract(np.array(logs, dtype=np.int64), np.array(stamps, dtype=np.int64)) for logs, stamps in pairs
        ]
        return np.concatenate(parts) / 1e9 if parts else np.empty(0)


def take(files: list[FileIndex]) -> Sample:
    """Sample a recording."""
    sample = Sample()
    runs = max(2, RUNS // max(1, len(files)))
    budget = _SIZE_LIMIT
    for index in files[:: max(1, len(files) // RUNS)]:
        if not index.chunks:
            continue
        with RecordFile(index.path) as file:
            for run in _spread(len(index.chunks), runs):
                budget -= sum(index.chunks[ordinal].length for ordinal in run)
                if budget < 0 and sample.runs:
                    return sample
                sample.runs.append(_read_run(file, index, run, sample))
    return sample


def _spread(count: int, runs: int) -> Iterator[range]:
    """Runs of chunk ordinals, evenly spread, without overlap."""
    if count <= runs * RUN_CHUNKS:
        yield range(count)
        return
    for start in np.linspace(0, count - RUN_CHUNKS, runs).astype(int):
        yield range(int(start), int(start) + RUN_CHUNKS)


def _read_run(file: RecordFile, index: FileIndex, run: range, sample: Sample) -> dict[str, Heads]:
    heads: dict[str, Heads] = {}
    for ordinal in run:
        record = index.chunks[ordinal]
        try:
            body = chunk_body(file, chunk_header(file, record))
        except ChunkDamaged as damage:
            sample.damages.append(f"a chunk at byte {record.offset:,}: {damage}")
            continue
        sample.bodies += 1
        for topic, series in index.series.items():
            start, end = np.searchsorted(series.chunk, [ordinal, ordinal + 1])
            into = heads.setdefault(topic, Heads())
            stamped = has_stamp(index.topics[topic].type_name)
            for offset in series.offsets[start:end].tolist():
                _take_head(body, offset, into, stamped=stamped)
    return heads


def has_stamp(type_name: str) -> bool:
    """Whether messages of the type begin with a time stamp."""
    return type_name.startswith(_STAMPED_PREFIXES) or type_name.endswith(_STAMPED_ENDINGS)


def _take_head(body: bytes, offset: int, into: Heads, *, stamped: bool) -> None:
    at = offset + HEADER_SIZE
    if at + _MESSAGE.size + 12 > len(body):
        return
    _, sequence, log_ns, stamp_ns = _MESSAGE.unpack_from(body, at)
    if stamped:
        order = "<" if body[at + _MESSAGE.size + 1] & 1 else ">"
        seconds, nanoseconds = struct.unpack_from(f"{order}iI", body, at + _MESSAGE.size + 4)
        stamp_ns = seconds * 1_000_000_000 + nanoseconds
    into.log_ns.append(min(log_ns, _LATEST_NS))
    into.stamp_ns.append(min(stamp_ns, _LATEST_NS))
    into.sequence.append(sequence)
