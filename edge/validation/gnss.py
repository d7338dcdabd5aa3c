"""How much of a recording has a position from GNSS."""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterator, Sequence

from drivers.messages import QUALITY_NAMES
from edge.recording.chunk import ChunkDamaged, chunk_body, chunk_header
from edge.recording.scan import HEADER_SIZE, RecordFile
from edge.validation.index import FileIndex, Series
from edge.validation.report import Finding, GnssShare, Level
from edge.validation.told import Told

_QUALITY_NAMES = {str(int(quality)): name for quality, name in QUALITY_NAMES.items()}
_STATUS_NAMES = {-1: "no fix", 0: "fix", 1: "satellite-augmented fix", 2: "ground-augmented fix"}
_NO_FIX = "no fix"
_HEAD = 160
"""Bytes of a NavSatFix up to its latitude, with a frame name of up to 80 characters."""
_MESSAGE_HEAD = HEADER_SIZE + 22
_SAMPLED_CHUNKS, _SAMPLED_PLACES = 60, 1200
"""Chunks whose fixes are looked at, at most: compressed ones are read whole, of others only the fixes."""


def share_of(files: Sequence[FileIndex], topic: str, said: Told | None) -> GnssShare | None:
    """From the recorder's own count where it covers the session, else from the messages."""
    count = sum(index.series[topic].times_ns.size for index in files if topic in index.series)
    if said is not None and said.last and said.gnss_quality:
        told = Counter({_QUALITY_NAMES.get(key, f"quality {key}"): n for key, n in said.gnss_quality.items()})
        return _share(told, "the recorder's count")
    if count == 0:
        return None
    qualities: Counter[str] = Counter()
    sampled = False
    for index in files:
        if topic in index.series and index.topics[topic].type_name.endswith("/NavSatFix"):
            sampled |= _count(index, index.series[topic], qualities, len(files))
    return _share(qualities, "a sample of the fixes" if sampled else "every fix")


def _share(qualities: Counter[str], source: str) -> GnssShare | None:
    epochs = sum(qualities.values())
    if epochs == 0:
        return None
    return GnssShare(epochs, 1 - qualities[_NO_FIX] / epochs, dict(qualities.most_common()), source)


def _count(index: FileIndex, series: Series, qualities: Counter[str], files: int) -> bool:
    """Count the fixes of one file. Returns whether only some of them were read."""
    compressed = any(index.compressions.keys() - {""})
    ordinals = sorted({int(ordinal) for ordinal in series.chunk if ordinal >= 0})
    most = max(2, (_SAMPLED_CHUNKS if compressed else _SAMPLED_PLACES) // files)
    chosen = ordinals[:: math.ceil(len(ordinals) / most)] if ordinals else ordinals
    keep = set(chosen)
    with RecordFile(index.path) as file:
        file.read_scattered()
        for ordinal, offsets in _by_chunk(series):
            if ordinal in keep:
                for head in _heads(file, index, ordinal, offsets, compressed=compressed):
                    qualities[fix_name(head)] += 1
    return len(chosen) < len(ordinals)


def _by_chunk(series: Series) -> Iterator[tuple[int, list[int]]]:
    found: dict[int, list[int]] = {}
    for ordinal, offset in zip(series.chunk.tolist(), series.offsets.tolist(), strict=True):
        found.setdefault(ordinal, []).append(offset)
    yield from found.items()


def _heads(
    file: RecordFile, index: FileIndex, ordinal: int, offsets: list[int], *, compressed: bool
) -> Iterator[bytes]:
    """The first bytes of the messages at these offsets; uncompressed ones are read where they lie."""
    try:
        header = chunk_header(file, index.chunks[ordinal])
        body = chunk_body(file, header) if compressed else b""
    except ChunkDamaged:
        return
    for offset in offsets:
        at = offset + _MESSAGE_HEAD
        yield body[at : at + _HEAD] if compressed else file.read(header.data_offset + at, _HEAD)


def fix_name(cdr: bytes) -> str:
    """The quality of a NavSatFix in words, from its first bytes."""
    order = "<" if len(cdr) > 1 and cdr[1] & 1 else ">"
    try:
        (length,) = struct.unpack_from(f"{order}I", cdr, 12)
        (status,) = struct.unpack_from("b", cdr, 16 + length)
        latitude_at = 4 + -(-(12 + length + 4) // 8) * 8  # status, service (u16), then aligned to 8
        (latitude,) = struct.unpack_from(f"{order}d", cdr, latitude_at)
    except struct.error:
        return "unreadable"
    return _NO_FIX if math.isnan(latitude) else _STATUS_NAMES.get(status, f"status {status}")


def check(share: GnssShare | None, min_fix_share: float, topic: str) -> Iterator[Finding]:
    """Enough of the way must have a position."""
    advice = "Give the antenna a free view of the sky, and wait for a fix before walking into the forest."
    if share is None:
        return
    if share.fix_share == 0:
        yield Finding(Level.WARN, topic, f"GNSS never had a position ({share.source}).", advice)
    elif share.fix_share < min_fix_share:
        text = f"GNSS had a position only {share.fix_share:.0%} of the time ({share.source})."
        yield Finding(Level.WARN, topic, text, advice)
