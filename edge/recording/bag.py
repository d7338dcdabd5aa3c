"""The session folder as a rosbag2 bag: facts about each split, and `metadata.yaml` (layout 5) made from them."""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec
from mcap.exceptions import McapError
from mcap.reader import make_reader

from edge.errors import FormatError
from edge.ros.topics import Channel

METADATA_YAML = "metadata.yaml"


class SplitFacts(msgspec.Struct, frozen=True):
    """One finished file. Stamps are log times, session time; 0 when it holds no message."""

    file: str
    start_ns: int
    end_ns: int
    size_bytes: int
    counts: dict[str, int]
    """Messages by topic."""

    @property
    def messages(self) -> int:
        return sum(self.counts.values())


def read_facts(path: Path) -> tuple[SplitFacts, list[Channel]]:
    """Facts of a finished file from its summary. FormatError when it has none."""
    try:
        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
    except (McapError, OSError, ValueError, LookupError, struct.error) as error:
        raise FormatError(f"{path}: not a finished MCAP file: {error}") from error
    if summary is None or summary.statistics is None:
        raise FormatError(f"{path}: no summary; run `mapforest recover` on it")
    channels = [
        Channel(one.topic, summary.schemas[one.schema_id].name, one.metadata.get("offered_qos_profiles", ""))
        for one in summary.channels.values()
    ]
    statistics = summary.statistics
    counts = {
        one.topic: count
        for one in summary.channels.values()
        if (count := statistics.channel_message_counts.get(one.id, 0))
    }
    start_ns, end_ns = statistics.message_start_time, statistics.message_end_time
    return SplitFacts(path.name, start_ns, end_ns, path.stat().st_size, counts), channels


def counts_by_topic(splits: Iterable[SplitFacts]) -> dict[str, int]:
    """Messages by topic in all of them."""
    counts: Counter[str] = Counter()
    for split in tuple(splits):
        counts.update(split.counts)
    return dict(counts)


def metadata_yaml(splits: Sequence[SplitFacts], channels: Iterable[Channel]) -> bytes:
    """The text of `metadata.yaml`. Strings are quoted as JSON, which is YAML; the QoS text is the channel's own."""
    start_ns, end_ns = _span(splits)
    lines = [
        "rosbag2_bagfile_information:",
        "  version: 5",
        "  storage_identifier: mcap",
        "  duration:",
        f"    nanoseconds: {end_ns - start_ns}",
        "  starting_time:",
        f"    nanoseconds_since_epoch: {start_ns}",
        f"  message_count: {sum(split.messages for split in splits)}",
        "  topics_with_message_count:",
        *(line for channel in channels for line in _topic(channel, splits)),
        '  compression_format: ""',
        '  compression_mode: ""',
        "  relative_file_paths:",
        *(f"    - {json.dumps(split.file)}" for split in splits),
        "  files:",
        *(line for split in splits for line in _file(split)),
    ]
    return ("\n".join(lines) + "\n").encode()


def _span(splits: Sequence[SplitFacts]) -> tuple[int, int]:
    filled = [split for split in splits if split.messages]
    if not filled:
        return 0, 0
    return min(split.start_ns for split in filled), max(split.end_ns for split in filled)


def _topic(channel: Channel, splits: Sequence[SplitFacts]) -> list[str]:
    return [
        "    - topic_metadata:",
        f"        name: {json.dumps(channel.topic)}",
        f"        type: {json.dumps(channel.type_name)}",
        "        serialization_format: cdr",
        f"        offered_qos_profiles: {json.dumps(channel.offered_qos)}",
        f"      message_count: {sum(split.counts.get(channel.topic, 0) for split in splits)}",
    ]


def _file(split: SplitFacts) -> list[str]:
    return [
        f"    - path: {json.dumps(split.file)}",
        "      starting_time:",
        f"        nanoseconds_since_epoch: {split.start_ns}",
        "      duration:",
        f"        nanoseconds: {split.end_ns - split.start_ns}",
        f"      message_count: {split.messages}",
    ]
