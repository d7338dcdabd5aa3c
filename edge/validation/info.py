"""What is in a recording, without a judgement."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from edge.validation.rates import Span, rates_of
from edge.validation.recording import Recording

_SLOW_HZ = 2.0
_NOT_SHOWN = {"config_toml", "calibration_toml"}


class TopicInfo(msgspec.Struct, frozen=True):
    """One topic. slowest_hz, fastest_hz: over windows of one second, of ten below 2 Hz."""

    name: str
    type_name: str
    encoding: str
    count: int
    rate_hz: float
    slowest_hz: float
    fastest_hz: float


class FileInfo(msgspec.Struct, frozen=True):
    """One file. problems: why it had to be walked instead of read by its index."""

    name: str
    size_bytes: int
    messages: int
    chunks: int
    compression: str
    profile: str
    library: str
    finished: bool
    attachments: int
    metadata: tuple[str, ...]
    problems: tuple[str, ...]


class Info(msgspec.Struct, frozen=True):
    """A recording at a glance. session: what the recorder noted, empty in foreign recordings."""

    target: str
    session: dict[str, str]
    ended: str
    marks: int
    start_ns: int
    end_ns: int
    duration_s: float
    size_bytes: int
    messages: int
    files: tuple[FileInfo, ...]
    topics: tuple[TopicInfo, ...]
    unreadable: dict[str, str]


def info(targets: Sequence[Path]) -> Info:
    """Read the indexes of a recording. FormatError when there is none."""
    recording = Recording.read(targets)
    return Info(
        target=recording.name,
        session={key: value for key, value in (recording.facts or {}).items() if key not in _NOT_SHOWN},
        ended=recording.said.ended if recording.said else "",
        marks=len(recording.said.marks) if recording.said else 0,
        start_ns=recording.span.start_ns,
        end_ns=recording.span.end_ns,
        duration_s=recording.span.duration_s,
        size_bytes=sum(index.size for index in recording.files),
        messages=sum(times.size for times in recording.times.values()),
        files=_files(recording),
        topics=tuple(_topic(name, recording) for name in sorted(recording.topics)),
        unreadable=recording.unreadable,
    )


def _files(recording: Recording) -> tuple[FileInfo, ...]:
    return tuple(
        FileInfo(
            name=index.path.name,
            size_bytes=index.size,
            messages=sum(series.times_ns.size for series in index.series.values()),
            chunks=len(index.chunks),
            compression=index.compression,
            profile=index.profile,
            library=index.library,
            finished=index.finished,
            attachments=index.attachments,
            metadata=tuple(index.metadata),
            problems=tuple(index.damages),
        )
        for index in recording.files
    )


def _topic(name: str, recording: Recording) -> TopicInfo:
    topic, times = recording.topics[name], recording.times.get(name)
    if times is None:
        return TopicInfo(name, topic.type_name, topic.encoding, 0, 0.0, 0.0, 0.0)
    rate_hz = rates_of(times, recording.span).rate_hz
    slowest_hz, fastest_hz = extremes_hz(times, recording.span, 1.0 if rate_hz >= _SLOW_HZ else 10.0)
    return TopicInfo(name, topic.type_name, topic.encoding, times.size, rate_hz, slowest_hz, fastest_hz)


def extremes_hz(times_ns: npt.NDArray[np.int64], span: Span, window_s: float) -> tuple[float, float]:
    """Least and largest rate over the whole windows of the session; zeros where it is shorter than one."""
    windows = int(span.duration_s / window_s)
    if windows == 0:
        return 0.0, 0.0
    counts = np.bincount(((times_ns - span.start_ns) // int(window_s * 1e9)).astype(np.int64), minlength=windows)[
        :windows
    ]
    return float(counts.min()) / window_s, float(counts.max()) / window_s
