"""One recording under load: its CPU, its losses, its memory."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from benchmarks.recording.audit import audit
from benchmarks.recording.bench import Bench, lost, recorder, trouble, wait_for_verdict
from benchmarks.recording.cpu import Usage, load_average, niceness, rss_mib, usage
from benchmarks.recording.load import Load
from benchmarks.recording.payload import payload
from edge.control.messages import Request

SETTLE_S = 3.0


@dataclass(frozen=True, slots=True)
class Trial:
    """cores: CPU seconds per second. lost_by_stream: the drivers' counters over the session."""

    factor: int
    seconds: float
    cores: float
    cores_idle: float
    """The same with all sensors streaming and nothing being recorded."""
    cores_by_thread: dict[str, float]
    senders_cores: dict[str, float]
    sender_pause_s: float
    """The longest the LiDAR's sender was held up: what follows is a burst no LiDAR would send."""
    lost_by_stream: dict[str, int]
    trouble: dict[str, int]
    dropped: int
    missing: dict[str, int]
    counts: dict[str, int]
    events: tuple[str, ...]
    megabytes_per_s: float
    verdict: str
    reasons: tuple[str, ...]
    flush_worst_ms: float
    rss_mib: tuple[float, ...]
    """Every tenth of the time, at least every 10 s."""
    load_average: str
    nice: int
    """Priority of the recorder: -5 as in its unit, 0 where that was not granted."""

    @property
    def losses(self) -> int:
        return sum(self.lost_by_stream.values()) + self.dropped + sum(self.missing.values())


def record(
    folder: Path, load: Load, seconds: float, keep: bool = False, inspect: Callable[[Path], None] | None = None
) -> Trial:
    """Record for `seconds` and look at what came of it. `inspect` sees the session's folder before it goes."""
    with payload(load) as senders, recorder(folder, load) as bench:
        time.sleep(SETTLE_S)
        idle = _cores(bench, min(seconds, 5.0))
        status = bench.client.status()
        lost_before, trouble_before = lost(status), trouble(status)
        session = Path(bench.client.request(Request("start", mission="bench")).folder)
        time.sleep(SETTLE_S)
        sent_before = {name: usage(pid) for name, pid in senders.pids.items()}
        senders.pause_s.value = 0.0
        start, start_s = usage(bench.pid), time.monotonic()
        rss, flush_worst_ms = _watch(bench, seconds)
        end, elapsed_s = usage(bench.pid), time.monotonic() - start_s
        senders_cores = {
            name: (usage(pid).process_s - sent_before[name].process_s) / elapsed_s for name, pid in senders.pids.items()
        }
        pause_s = senders.pause_s.value
        status = bench.client.status()
        dropped = status.recording.dropped if status.recording else 0
        lost_after, trouble_after = lost(status), trouble(status)
        load_was, nice = load_average(), niceness(bench.pid)
        bench.client.request(Request("stop"))
        verdict, reasons = wait_for_verdict(bench.client)
    audited = audit(session, load)
    if inspect is not None:
        inspect(session)
    if not keep:
        shutil.rmtree(session)
    return Trial(
        factor=load.factor,
        seconds=elapsed_s,
        cores=(end.process_s - start.process_s) / elapsed_s,
        cores_idle=idle,
        cores_by_thread=_by_thread(start, end, elapsed_s),
        senders_cores=senders_cores,
        sender_pause_s=pause_s,
        lost_by_stream=_since(lost_before, lost_after),
        trouble=_since(trouble_before, trouble_after),
        dropped=dropped,
        missing=audited.missing,
        counts=audited.counts,
        events=audited.events,
        megabytes_per_s=audited.bytes / (elapsed_s + SETTLE_S) / 1e6,
        verdict=verdict,
        reasons=reasons,
        flush_worst_ms=flush_worst_ms,
        rss_mib=rss,
        load_average=load_was,
        nice=nice,
    )


def _cores(bench: Bench, seconds: float) -> float:
    before, start_s = usage(bench.pid), time.monotonic()
    time.sleep(seconds)
    return (usage(bench.pid).process_s - before.process_s) / (time.monotonic() - start_s)


def _watch(bench: Bench, seconds: float) -> tuple[tuple[float, ...], float]:
    """Memory on the way, and the worst flush seen. Asks the recorder nothing but its state, every few seconds."""
    rss, worst_ms = [rss_mib(bench.pid)], 0.0
    end_s = time.monotonic() + seconds
    while (left_s := end_s - time.monotonic()) > 0:
        time.sleep(min(left_s, 10.0, seconds / 10))
        rss.append(rss_mib(bench.pid))
        recording = bench.client.status().recording
        worst_ms = max(worst_ms, recording.flush_ms if recording else 0.0)
    return tuple(rss), worst_ms


def _since(before: dict[str, int], after: dict[str, int]) -> dict[str, int]:
    return {name: value - before.get(name, 0) for name, value in after.items()}


def _by_thread(start: Usage, end: Usage, elapsed_s: float) -> dict[str, float]:
    spent = {name: (end.threads_s[name] - start.threads_s[name]) / elapsed_s for name in end.threads_s}
    return dict(sorted(spent.items(), key=lambda one: -one[1]))
