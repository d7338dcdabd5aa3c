"""How the sensors and the computer did, over time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from edge.config import Config
from edge.errors import FormatError
from edge.replay.store import MessageStore
from edge.ros import schemas
from edge.ros.decode import DiagnosticArray, decode_diagnostics
from edge.validation.report import Level, Report, TopicReport
from pipeline.products import sheet
from pipeline.products.page import TIME
from pipeline.products.plots import Line, Plot

_SLOW_HZ = 4.0
"""Of topics slower than this a curve tells nothing that the table does not."""
_STRETCHES = 400
"""Points of a curve at most: a rate is the mean over a stretch."""
_SAMPLED = 300
"""Diagnostics that are read: each is in a chunk of a megabyte."""
_HEAD = ("topic", "messages", "a second", "expected", "longest gap", "judged")
_WORD = {Level.NOTE: "ok", Level.WARN: "warn", Level.FAIL: "fail"}
_HEALTH = (
    ("Temperature, °C", "°C", (("host", "temperature_c"), ("sensor/livox", "temperature_c"))),
    ("Load of the computer, %", "%", (("host", "cpu_percent"), ("host", "memory_percent"))),
    ("Queue of the recorder, share in use", "share", (("recorder", "queue_fill"),)),
)
"""Title, unit, and the (status, key) of each line."""


def sensor_parts(targets: Sequence[Path], judged: Report, config: Config) -> Iterator[str]:
    """From the times of the messages, and from what the recorder wrote about itself."""
    yield sheet.section("Sensors")
    store = MessageStore(targets)
    yield sheet.table(_HEAD, list(map(_row, _judged(judged))))
    for topic in _judged(judged):
        if topic.count > 1 and (topic.expected_hz or 0.0) >= _SLOW_HZ:
            yield sheet.figure(f"{topic.name}, messages a second", _rate(store.times_ns(topic.name), topic, judged))
    name = store.recording.effective(config).topics.diagnostics
    read = list(_diagnostics(store, name))
    if not read:
        yield sheet.words("The recording has no diagnostics: temperatures and loads are not known.")
    for title, unit, wanted in _HEALTH:
        lines = list(_lines(read, wanted, judged.start_ns))
        if lines:
            yield sheet.figure(title, Plot(TIME, unit, lines, from_zero=True, height=150))


def _judged(judged: Report) -> list[TopicReport]:
    return [topic for topic in judged.topics if topic.required or topic.expected_hz]


def _row(topic: TopicReport) -> tuple[str, ...]:
    name = sheet.text(topic.name)
    expected = f"{topic.expected_hz:.4g}" if topic.expected_hz else ""
    if topic.count < 2:
        return name, str(topic.count), "", expected, "", _WORD[topic.level]
    gap = f"{topic.largest_gap_s:.2f} s, after {topic.gap_at_s:.0f} s"
    return name, f"{topic.count:,}", f"{topic.rate_hz:.4g}", expected, gap, _WORD[topic.level]


def _rate(times_ns: npt.NDArray[np.int64], topic: TopicReport, judged: Report) -> Plot:
    hz = topic.expected_hz or 1.0
    stretch_s = max(1.0, 10.0 / hz, judged.duration_s / _STRETCHES)
    edges = np.arange(0.0, max(judged.duration_s, 2 * stretch_s) + 1e-9, stretch_s)
    counts, _ = np.histogram((times_ns - judged.start_ns) / 1e9, edges)
    middle = (edges[:-1] + edges[1:]) / 2.0
    lines = [Line(edges[[0, -1]], np.full(2, hz), "expected", "c"), Line(middle, counts / stretch_s, "received")]
    return Plot(TIME, "Hz", lines, from_zero=True, height=140)


def _diagnostics(store: MessageStore, topic: str) -> Iterator[DiagnosticArray]:
    known = store.topics.get(topic)
    if known is None or known.type_name != schemas.DIAGNOSTIC_ARRAY:
        return
    count = store.count(topic)
    chosen = np.unique(np.linspace(0, count - 1, min(count, _SAMPLED)).astype(int)).tolist()
    for raw in store.some(topic, chosen):
        try:
            yield decode_diagnostics(raw.data)
        except FormatError:  # one that is broken is one that is missing
            continue


def _lines(read: list[DiagnosticArray], wanted: Sequence[tuple[str, str]], start_ns: int) -> Iterator[Line]:
    for (status, key), tone in zip(wanted, "abc", strict=False):
        found = [
            ((one.stamp_ns - start_ns) / 1e9, float(value))
            for one in read
            for told in one.statuses
            if told.name == status
            for name, value in told.values
            if name == key
        ]
        if len(found) > 1:
            x, y = np.array(found).T
            yield Line(x, y, f"{status.removeprefix('sensor/')} {key.rpartition('_')[0]}", tone)
