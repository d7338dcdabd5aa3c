"""The clock estimates that a session carries in its diagnostics, compared with an emulated payload's true clocks."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from mcap.reader import make_reader

from edge.config import Topics
from edge.errors import FormatError
from edge.ros.decode import Status, decode_diagnostics
from edge.validation.files import recording_files
from pipeline.evaluation.clocks import ClockErrors, ClockEstimates, ClockTruth, clock_errors

_PREFIX = "sensor/"
_KEYS = ("clock.updated_ns", "clock.offset_ns", "clock.skew_ppm", "clock.sigma_ns")


class ClockReport(msgspec.Struct, frozen=True):
    """How well one sensor's clock was estimated."""

    sensor: str
    errors: ClockErrors


def clock_reports(session: Path, truth: Path, settle_s: float = 10.0) -> list[ClockReport]:
    """One report a sensor with a truth file `clock_<sensor>.jsonl`. FormatError when there is nothing to compare."""
    estimates = _estimates(session)
    files = sorted(truth.glob("clock_*.jsonl"))
    if not files:
        raise FormatError(f"{truth}: no clock_*.jsonl in it; give the folder that `mapforest sim --truth` wrote")
    reports = []
    for file in files:
        sensor = file.stem.removeprefix("clock_")
        if sensor not in estimates:
            raise FormatError(f"{session}: no clock of {sensor!r} in its diagnostics")
        try:
            reports.append(ClockReport(sensor, clock_errors(estimates[sensor], _truth(file), settle_s)))
        except ValueError as error:
            raise FormatError(f"{session}: {sensor}: {error}") from error
    return reports


def _truth(file: Path) -> ClockTruth:
    lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines() if line.endswith("}")]
    pairs = np.array([(line["host_ns"], line["sensor_ns"]) for line in lines], dtype=np.int64).reshape(-1, 2)
    return ClockTruth(pairs[:, 0], pairs[:, 1])


def _estimates(session: Path) -> dict[str, ClockEstimates]:
    rows: dict[str, list[dict[str, str]]] = defaultdict(list)
    for status in _statuses(session):
        values = dict(status.values)
        if status.name.startswith(_PREFIX) and all(key in values for key in _KEYS):
            rows[status.name.removeprefix(_PREFIX)].append(values)
    return {sensor: _columns(values) for sensor, values in rows.items()}


def _statuses(session: Path) -> Iterator[Status]:
    for path in recording_files([session]):
        with path.open("rb") as file:
            for _, _, message in make_reader(file).iter_messages(topics=[Topics().diagnostics]):
                yield from decode_diagnostics(message.data).statuses


def _columns(rows: list[dict[str, str]]) -> ClockEstimates:
    sensor_ns = np.array([int(row["clock.updated_ns"]) for row in rows], dtype=np.int64)
    offset_ns = np.array([int(row["clock.offset_ns"]) for row in rows], dtype=np.int64)
    return ClockEstimates(
        at_ns=sensor_ns + offset_ns,
        sensor_ns=sensor_ns,
        offset_ns=offset_ns,
        skew_ppm=np.array([float(row["clock.skew_ppm"]) for row in rows]),
        sigma_ns=np.array([float(row["clock.sigma_ns"]) for row in rows]),
    )
