"""What is in the files, against what was sent: an oracle that knows no counter of the drivers or the recorder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from benchmarks.recording.load import RETURNS_PER_PACKET, SENTENCES_PER_EPOCH, Load
from edge.ros.decode import decode_log, decode_point_cloud

LIDAR, IMU, FIX, NMEA, VIDEO = "/livox/lidar", "/livox/imu", "/gnss/fix", "/gnss/nmea", "/camera/video"
EVENTS = "/events"
SHUTTER_NS = 2_500_000_000
"""A HERO8 interrupts its stream when it starts to record on its card, which the start of a session makes it do."""


@dataclass(frozen=True, slots=True)
class Audit:
    """Messages by topic of the whole session, and what is missing in its steady part (0: all is there)."""

    counts: dict[str, int]
    missing: dict[str, int]
    events: tuple[str, ...]
    """What the recorder noted, as seconds after the first message and text."""
    bytes: int


def audit(folder: Path, load: Load) -> Audit:
    """Read a whole session. Points are counted as packets of 53 returns."""
    counts: Counter[str] = Counter()
    stamps: dict[str, list[int]] = {}
    widths: list[int] = []
    events: list[str] = []
    steady_ns = 0
    for topic, stamp_ns, data in messages(folder):
        steady_ns = steady_ns or stamp_ns + SHUTTER_NS
        counts[topic] += 1
        if topic == EVENTS:
            events.append(f"{(stamp_ns - steady_ns + SHUTTER_NS) / 1e9:.1f} s: {decode_log(data).text}")
        if stamp_ns < steady_ns:
            continue
        stamps.setdefault(topic, []).append(stamp_ns)
        if topic == LIDAR:
            widths.append(len(decode_point_cloud(data).points))
    missing = {
        IMU: _holes(stamps.get(IMU, []), load.imu_ns),
        FIX: _holes(stamps.get(FIX, []), load.epoch_ns),
        VIDEO: _holes(stamps.get(VIDEO, []), load.frame_90khz * 100_000 // 9),
        NMEA: _missing_sentences(stamps.get(NMEA, [])),
        LIDAR: _missing_packets(widths, stamps.get(LIDAR, []), load),
    }
    size = sum(path.stat().st_size for path in folder.glob("*.mcap"))
    return Audit(dict(counts), missing, tuple(events), size)


def messages(folder: Path) -> Iterator[tuple[str, int, bytes]]:
    """(topic, publish time, data) of all splits, in the order of the file."""
    for path in sorted(folder.glob("*.mcap"), key=lambda one: int(one.stem.rpartition("_")[2])):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                yield channel.topic, message.publish_time, message.data


def _holes(stamps_ns: Sequence[int], period_ns: int) -> int:
    """Messages that lack between the first and the last; all, when there are hardly any."""
    if len(stamps_ns) < 2:
        return 1
    steps = np.rint(np.diff(np.sort(np.array(stamps_ns))) / period_ns).astype(int)
    return int(np.sum(np.maximum(steps - 1, 0)))


def _missing_sentences(stamps_ns: Sequence[int]) -> int:
    """Epochs that are not whole; the first and the last may be cut by the start and the stop."""
    _, counts = np.unique(np.array(stamps_ns, np.int64), return_counts=True)
    return int(np.sum(SENTENCES_PER_EPOCH - counts[1:-1])) if len(counts) > 2 else 1


def _missing_packets(widths: Sequence[int], stamps_ns: Sequence[int], load: Load) -> int:
    """Packets that lack among the scans. The first and the last may be cut; neighbours share a packet."""
    if len(widths) < 4:
        return 1
    span_ns = stamps_ns[-1] - stamps_ns[1]
    expected = span_ns / load.packet_ns
    found = sum(widths[1:-1]) / RETURNS_PER_PACKET
    return max(0, round(expected - found))
