"""Access units made into stamped video frames, and what there is to count about them."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass, replace

from drivers.clock import ClockState, SensorClock
from drivers.driver import StreamHealth
from drivers.gopro import h264
from drivers.gopro.pts import PtsTimeline
from drivers.gopro.transport_stream import AccessUnit
from drivers.messages import VideoFrame

REJOIN_NS = 500_000_000
"""A stream that comes back sooner on the same clock is gone on with, like after a loss; later ones start anew."""
PERIODS = 31
"""Frame spacings of which the smallest is the nominal one: losses only make spacings longer."""


@dataclass(frozen=True, slots=True)
class Placed:
    """A frame, and whether the camera's stream clock began anew with it."""

    frame: VideoFrame | None
    new_epoch: bool


class FrameBuilder:
    """Gates on the first decodable frame of a stream, maps PTS to host time, counts. Fed by one thread."""

    def __init__(self, latency_ns: int) -> None:
        self._latency_ns = latency_ns
        self._timeline = PtsTimeline()
        self._clock: SensorClock | None = None
        self._earlier_steps = 0
        self._received_ns = 0
        self._waiting = True
        self._restarted = False
        self._steps: deque[int] = deque(maxlen=PERIODS)
        self._lock = threading.Lock()
        self._state: ClockState | None = None
        self.tally = FrameTally()

    def restarted(self) -> None:
        """The stream was started (again): expect a hole, or another clock origin."""
        self._restarted = True
        self._timeline.restarted()

    def add(self, unit: AccessUnit) -> Placed:
        """Take one access unit in. The frame is None before the first SPS + PPS + IDR of a clock epoch."""
        place = self._timeline.place(unit.pts, unit.receive_ns)
        if place.new_epoch:
            self._start_epoch()
        if place.new_epoch or (self._restarted and unit.receive_ns - self.tally.last_ns > REJOIN_NS):
            self._waiting = True
        self._restarted = False
        assert self._clock is not None
        self._clock.observe(place.sensor_ns, unit.receive_ns)
        missing = self._missing(place.step_ticks)
        kind = h264.kind(unit.data)
        self._waiting = self._waiting and not kind.entry
        with self._lock:
            self._state = self._clock.state()
        if self._waiting:
            self.tally.skip()
            return Placed(None, place.new_epoch)
        self.tally.count(unit.receive_ns, missing)
        stamp_ns = self._clock.to_host_ns(place.sensor_ns)
        # A frame that was overtaken keeps its place in the file, which readers sort by reception.
        self._received_ns = max(self._received_ns, unit.receive_ns)
        return Placed(VideoFrame(stamp_ns, self._received_ns, unit.data, kind.idr, unit.pts), place.new_epoch)

    def clock_state(self) -> ClockState | None:
        """From any thread. Steps include the new epochs."""
        with self._lock:
            return None if self._state is None else replace(self._state, steps=self._state.steps + self._earlier_steps)

    def _start_epoch(self) -> None:
        with self._lock:
            if self._state is not None:
                self._earlier_steps += self._state.steps + 1
        self._clock = SensorClock(latency_ns=self._latency_ns)
        self._steps.clear()

    def _missing(self, step: int) -> int:
        """Frames that should have been between this one and the one before, by their PTS."""
        if step <= 0:
            return 0
        self._steps.append(step)
        return max(0, round(step / min(self._steps)) - 1)


class FrameTally:
    """Frames received and lost. Written by the receiving thread, read by any."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._received = 0
        self._lost = 0
        self._skipped = 0
        self._reported = 0
        self._reported_at = time.monotonic()
        self._last_ns = 0
        self._gap_ns = 0

    def count(self, receive_ns: int, missing: int) -> None:
        """One frame, and how many are missing before it."""
        with self._lock:
            if self._last_ns:
                self._gap_ns = max(self._gap_ns, receive_ns - self._last_ns)
            self._last_ns = receive_ns
            self._received += 1
            self._lost += missing

    def skip(self) -> None:
        """One frame that nobody could decode: it came before the first keyframe."""
        with self._lock:
            self._skipped += 1

    @property
    def received(self) -> int:
        """Frames since the driver started."""
        with self._lock:
            return self._received

    @property
    def skipped(self) -> int:
        """Frames before a first keyframe since the driver started."""
        with self._lock:
            return self._skipped

    @property
    def last_ns(self) -> int:
        """Arrival of the newest frame, 0 before the first."""
        with self._lock:
            return self._last_ns

    def report(self, expected_hz: float) -> StreamHealth:
        """Since the last report."""
        now = time.monotonic()
        with self._lock:
            elapsed_s = max(now - self._reported_at, 1e-3)
            rate_hz = (self._received - self._reported) / elapsed_s
            silence_ns = time.monotonic_ns() - self._last_ns if self._last_ns else 0
            gap_s = max(self._gap_ns, silence_ns) / 1e9
            self._reported, self._reported_at, self._gap_ns = self._received, now, 0
            return StreamHealth("video", rate_hz, expected_hz, self._received, self._lost, gap_s)
