"""One MCAP file of a session, while it is written: append-only, ROS 2 profile, readable up to the last flush."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO, cast

from mcap.writer import CompressionType, Writer

from edge.errors import ConfigError
from edge.recording.bag import SplitFacts
from edge.recording.disk import Disk
from edge.recording.summary import SESSION_RECORD, SUMMARY_KEY, SUMMARY_RECORD, TopicSpan
from edge.ros.schemas import schema_text
from edge.ros.topics import Channel

ACTIVE_SUFFIX = ".active"
_MESSAGE_HEAD_BYTES = 31
_COMPRESSION = {"none": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}


def compression_type(name: str) -> CompressionType:
    """ConfigError for a name that is not known."""
    if name not in _COMPRESSION:
        raise ConfigError(f"recording.compression: found {name!r}, expected one of {', '.join(_COMPRESSION)}")
    return _COMPRESSION[name]


class SplitFile:
    """Not thread-safe: one thread at a time, as the MCAP writer demands."""

    def __init__(
        self, disk: Disk, path: Path, compression: CompressionType, chunk_bytes: int, software: str = "mapforest"
    ) -> None:
        """path: the name the file gets once it is finished; until then it has `.active` behind it."""
        self.path = path
        self.active = path.with_name(path.name + ACTIVE_SUFFIX)
        self.topics: dict[str, TopicSpan] = {}
        self._chunk_bytes = chunk_bytes
        self._pending_bytes = 0
        self._ids: dict[str, int] = {}
        self._file = disk.create(self.active)
        self._mcap = Writer(cast("IO[bytes]", self._file), chunk_size=chunk_bytes, compression=compression)
        self._mcap.start(profile="ros2", library=software)

    @property
    def size_bytes(self) -> int:
        """On the file and about to be."""
        return self._file.tell() + self._pending_bytes

    def begin(self, session: Mapping[str, str], channels: Iterable[Channel]) -> None:
        """The record `session`, and every channel, so that all splits have the same ones."""
        self._mcap.add_metadata(SESSION_RECORD, dict(session))
        schemas: dict[str, int] = {}
        for channel in channels:
            if channel.topic in self._ids:
                continue
            name = channel.type_name
            if name not in schemas:
                schemas[name] = self._mcap.register_schema(name, "ros2msg", schema_text(name))
            qos = {"offered_qos_profiles": channel.offered_qos}
            self._ids[channel.topic] = self._mcap.register_channel(channel.topic, "cdr", schemas[name], qos)

    def write(self, topic: str, log_ns: int, publish_ns: int, sequence: int, data: bytes) -> None:
        """Append a message. A chunk is closed before it outgrows its limit; only a larger message exceeds it."""
        size = len(data) + _MESSAGE_HEAD_BYTES
        if self._pending_bytes + size > self._chunk_bytes:
            self.flush()
        self._mcap.add_message(self._ids[topic], log_ns, data, publish_ns, sequence & 0xFFFFFFFF)
        self._pending_bytes += size
        span = self.topics.get(topic)
        if span is None:
            self.topics[topic] = TopicSpan(1, log_ns, log_ns)
        else:
            first_ns, last_ns = min(span.first_ns, log_ns), max(span.last_ns, log_ns)
            self.topics[topic] = TopicSpan(span.count + 1, first_ns, last_ns)

    def flush(self) -> None:
        """Close the chunk and hand it to the kernel."""
        self._mcap.flush()  # type: ignore[no-untyped-call]
        self._pending_bytes = 0

    def sync(self) -> None:
        """Close the chunk, and return when everything is on the medium."""
        self.flush()
        self._file.sync()

    def finish(self, summary: bytes) -> SplitFacts:
        """Write the record `mapforest` with `summary` (JSON), the indexes and the footer; sync and close."""
        self.flush()
        self._mcap.add_metadata(SUMMARY_RECORD, {SUMMARY_KEY: summary.decode()})
        self._mcap.finish()  # type: ignore[no-untyped-call]
        self._file.sync()
        self._file.close()
        return self._facts()

    def close(self) -> None:
        """Let go of the file as it is."""
        self._file.close()

    def _facts(self) -> SplitFacts:
        start_ns = min((span.first_ns for span in self.topics.values()), default=0)
        end_ns = max((span.last_ns for span in self.topics.values()), default=0)
        counts = {topic: span.count for topic, span in self.topics.items()}
        return SplitFacts(self.path.name, start_ns, end_ns, self._file.tell(), counts)
