"""The thread that owns the files: takes from the queue, encodes, writes, flushes every second."""

from __future__ import annotations

import logging
import struct
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from drivers.messages import SensorEvent, Severity
from edge.config import Recording
from edge.recording.anchor import Anchor
from edge.recording.disk import Disk, floor_bytes
from edge.recording.messages import Recordable
from edge.recording.queue import RecordQueue
from edge.recording.splits import Splits, disk_problem
from edge.recording.summary import Tally, drops_by_topic
from edge.ros.encode import ENCODERS
from edge.ros.topics import Channel

_log = logging.getLogger(__name__)
_ROUND_S = 0.05
_FIRST_FLUSH_NS = 200_000_000
"""The first messages are on the disk within 0.3 s of the start key."""
_CLOCK_STEP_NS = 100_000_000


class SessionWriter:
    """`run` is the thread; `step` is one round of it. Counters may be read from any thread."""

    def __init__(
        self,
        queue: RecordQueue,
        splits: Splits,
        tally: Tally,
        *,
        channels: Mapping[type, Channel],
        anchor: Anchor,
        limits: Recording,
        folder: Path,
        disk: Disk,
        clock: Callable[[], int] = time.monotonic_ns,
        utc_offset: Callable[[], int] = lambda: Anchor.now().offset_ns,
    ) -> None:
        self.stop_reason = "stopped"
        self.ended = ""
        self.error = ""
        self.flush_ms = 0.0
        self.free_bytes = disk.space(folder).free_bytes
        self.last_progress_ns = clock()
        self._in_hand: deque[Recordable] = deque()
        self._queue = queue
        self._splits = splits
        self._tally = tally
        self._channels = channels
        self._anchor = anchor
        self._limits = limits
        self._folder = folder
        self._disk = disk
        self._clock = clock
        self._utc_offset = utc_offset
        self._next_flush_ns = clock() + _FIRST_FLUSH_NS
        self._utc_offset_ns = utc_offset()

    def run(self) -> None:
        """Thread root: write until the queue is closed and empty, then finish. Never raises."""
        try:
            while self.step():
                pass
            self._record_drops()
            self._splits.finish(self._summary(self.ended or self.stop_reason))
        except OSError as error:
            self._fail(disk_problem(self._folder, error))
        except Exception as error:
            _log.exception("the recorder's writer failed")
            self._fail(f"the recorder failed ({error!r}); what was written is kept. Start a new recording")
        self.error = self.error or self._splits.background.error

    def step(self) -> bool:
        """One round: what the queue holds, and a flush when it is time. False when the queue is closed and empty."""
        closed = self._queue.closed
        batch = self._queue.take(_ROUND_S)
        self._in_hand.extend(batch)
        while self._in_hand:
            self._write(self._in_hand[0])
            self._in_hand.popleft()
        now_ns = self.last_progress_ns = self._clock()
        if now_ns >= self._next_flush_ns:
            self._flush(now_ns)
        return bool(batch) or not closed

    def _write(self, message: Recordable) -> None:
        channel = self._channels[type(message)]
        stamp_ns, log_ns = self._anchor.session_ns(message.stamp_ns), self._anchor.session_ns(message.receive_ns)
        try:
            data = ENCODERS[type(message)](message, stamp_ns)
            struct.pack("<QQ", stamp_ns, log_ns)
        except (struct.error, ValueError, TypeError, OverflowError):
            _log.exception("a message of %s cannot be encoded and is lost", channel.topic)
            self._queue.count_drop(message)
            return
        if self._splits.due(log_ns):
            self._splits.roll(log_ns, self._summary("split"))
        self._splits.write(channel.topic, log_ns, stamp_ns, data)
        self._tally.add(message)

    def _flush(self, started_ns: int) -> None:
        self._record_drops()
        self._watch_clock()
        self._splits.current.sync()
        now_ns = self.last_progress_ns = self._clock()
        self.flush_ms = (now_ns - started_ns) / 1e6
        self._tally.flush_worst_ms = max(self._tally.flush_worst_ms, self.flush_ms)
        period_ns = int((self._limits.flush_s - _ROUND_S) * 1e9)  # a message may have waited a round already
        self._next_flush_ns = max(started_ns + period_ns, now_ns + period_ns // 5)
        self._watch_space()

    def _watch_space(self) -> None:
        space = self._disk.space(self._folder)
        self.free_bytes = space.free_bytes
        floor = floor_bytes(space, self._limits.min_free_mib, self._limits.min_free_percent)
        if space.free_bytes < floor and not self.ended:
            self.ended = (
                f"disk reserve reached: {space.free_bytes >> 20} MiB free, {floor >> 20} MiB are kept. "
                "Copy recordings off the card and delete them there"
            )
            self._event(Severity.ERROR, self.ended)
            self._queue.close()

    def _watch_clock(self) -> None:
        """A step of the system's clock becomes an event; session time goes on as it was."""
        offset_ns = self._utc_offset()
        step_ns = offset_ns - self._utc_offset_ns
        self._utc_offset_ns = offset_ns
        self._tally.clock_drift_ns = offset_ns - self._anchor.offset_ns
        if abs(step_ns) > _CLOCK_STEP_NS:
            self._tally.clock_steps += 1
            self._event(Severity.WARNING, f"system clock stepped by {step_ns / 1e9:+.3f} s; session time goes on")

    def _record_drops(self) -> None:
        for topic, drops in drops_by_topic(self._queue.new_drops(), self._channels, self._anchor).items():
            span = f"first_ns={drops.first_ns} last_ns={drops.last_ns}"
            self._event(Severity.ERROR, f"dropped {drops.count} messages of {topic} ({span}): the disk is too slow")

    def _event(self, severity: Severity, text: str) -> None:
        now_ns = self._clock()
        self._write(SensorEvent(now_ns, now_ns, "recorder", severity, text))

    def _summary(self, ended: str) -> bytes:
        dropped = drops_by_topic(self._queue.drops(), self._channels, self._anchor)
        splits = self._splits
        return msgspec.json.encode(self._tally.summary(splits.number, ended, splits.written(), dropped))

    def _fail(self, problem: str) -> None:
        """Keep what can be kept; the rest of the queue is counted as lost."""
        _log.error("%s", problem)
        self.error = problem
        self.ended = self.ended or "disk error"
        self._queue.abandon()
        for message in self._in_hand:
            self._queue.count_drop(message)
        self._splits.abandon()
