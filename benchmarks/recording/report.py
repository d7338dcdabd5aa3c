"""The table: what was measured, against what is asked for."""

from __future__ import annotations

import statistics
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.recording.start import Start
from benchmarks.recording.trial import Trial
from benchmarks.recording.writers import WriterCost

CORES, START_S, GROWTH_MIB = 0.25, 0.5, 5.0
JUDGED_S = 300.0
"""Memory is judged over at least this long."""
ROLES = {
    "livox-receive": "LiDAR and IMU: receive",
    "driver-livox": "LiDAR and IMU: check, decode, cut scans",
    "gopro-stream": "video: receive, demultiplex, frames",
    "driver-reach": "GNSS: receive, parse, epochs",
    "recorder-writer": "encode, write, flush",
    "main": "health, diagnostics, states",
    "driver-gopro": "camera: status, commands",
    "livox-steward": "LiDAR: status, commands",
    "control": "control socket",
}


@dataclass(frozen=True, slots=True)
class Results:
    """Everything that was measured; parts that were left out are empty."""

    machine: str
    load_average: str
    trials: tuple[Trial, ...] = ()
    starts: tuple[Start, ...] = ()
    encode: dict[str, float] | None = None
    writers: tuple[WriterCost, ...] = ()


@dataclass(frozen=True, slots=True)
class Row:
    """One line; `met` is None where there is no target."""

    what: str
    value: str
    target: str = ""
    met: bool | None = None


def rows(results: Results) -> Iterator[Row]:
    """All lines in order."""
    for trial in results.trials:
        yield from _trial_rows(trial)
    if results.starts:
        yield from _start_rows(results.starts)
    for topic, cores in (results.encode or {}).items():
        yield Row(f"encode {topic}", f"{cores:.4f} core")
    yield from _writer_rows(results.writers)


def text(results: Results) -> str:
    """The table for people."""
    table = [("what", "measured", "target", "")]
    for row in rows(results):
        met = {None: "", True: "met", False: "MISSED"}[row.met]
        table.append((row.what, row.value, row.target, met))
    widths = [max(len(line[column]) for line in table) for column in range(4)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in table]
    return "\n".join([f"{results.machine}; load average at the start {results.load_average}", "", *lines])


def _trial_rows(trial: Trial) -> Iterator[Row]:
    name = f"{trial.factor}x"
    target = (f"<= {CORES}", trial.cores <= CORES) if trial.factor == 1 else ("", None)
    value = f"{trial.cores:.3f} core over {trial.seconds:.0f} s, {trial.megabytes_per_s:.1f} MB/s"
    yield Row(f"{name} recorder process, recording", value, *target)
    yield Row(f"{name} recorder process, live only", f"{trial.cores_idle:.3f} core")
    for thread, cores in trial.cores_by_thread.items():
        if cores >= 0.0005:
            yield Row(f"{name}   {ROLES.get(thread, thread)}", f"{cores:.4f} core ({thread})")
    details = {**trial.lost_by_stream, **trial.missing, "dropped by the queue": trial.dropped, **trial.trouble}
    told = ", ".join(f"{name} {count}" for name, count in details.items() if count) or "0 of all streams"
    yield Row(f"{name} losses", told, "0", trial.losses == 0)
    for event in trial.events:
        yield Row(f"{name}   event", textwrap.shorten(event, 60, placeholder=" ..."))
    yield Row(f"{name} worst flush seen", f"{trial.flush_worst_ms:.1f} ms")
    value = f"{sum(trial.senders_cores.values()):.3f} core, held up for at most {trial.sender_pause_s * 1e3:.0f} ms"
    yield Row(f"{name} senders", value)
    yield Row(f"{name} load average", f"{trial.load_average}, recorder at nice {trial.nice}")
    if trial.factor == 1:
        yield _memory_row(trial)


def _memory_row(trial: Trial) -> Row:
    """Growth per ten minutes: a line through the second half, since the first splits warm up the allocator."""
    settled = trial.rss_mib[len(trial.rss_mib) // 2 :]
    step_s = trial.seconds / (len(trial.rss_mib) - 1)
    slope = float(np.polyfit(np.arange(len(settled)) * step_s, settled, 1)[0]) * 600
    value = f"{min(trial.rss_mib):.1f} to {max(trial.rss_mib):.1f} MiB, {slope:+.1f} MiB/10 min"
    met = slope <= GROWTH_MIB if trial.seconds >= JUDGED_S else None
    target = "flat" if met is not None else f"flat, judged from {JUDGED_S / 60:.0f} min"
    return Row(f"{trial.factor}x memory over {trial.seconds / 60:.1f} min", value, target, met)


def _start_rows(starts: Sequence[Start]) -> Iterator[Row]:
    for what, name in (("reply", "reply_s"), ("first message received", "received_s"), ("first on disk", "disk_s")):
        values = [getattr(start, name) for start in starts]
        worst = max(values)
        value = f"{statistics.median(values):.3f} s, worst {worst:.3f} s of {len(values)}"
        target = (f"< {START_S} s", worst < START_S) if name == "disk_s" else ("", None)
        yield Row(f"start key to {what}", value, *target)


def _writer_rows(writers: Sequence[WriterCost]) -> Iterator[Row]:
    for way in ("at_once", "paced"):
        costs = {cost.writer: getattr(cost, f"{way}_cores") for cost in writers if getattr(cost, way)}
        for name, cores in costs.items():
            ratios = ", ".join(f"{cores / costs[other]:.2f} of {other}" for other in ("mcap", "foxglove-sdk"))
            value = f"{cores:.4f} core, {ratios}"
            yield Row(f"write {way.replace('_', ' ')}: {name}", value)
