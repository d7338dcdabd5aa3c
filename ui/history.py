"""What the screen remembers of the last minutes, since a status only says how things are now."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from edge.control.messages import Status, Stream

SAMPLES = 120
"""One a second, more than the widest sparkline shows."""
LOSING_S = 10
"""A loss is news for this long; afterwards it is a number."""


@dataclass
class StreamHistory:
    """One stream's past, one sample a second. ratios: measured over expected rate."""

    ratios: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    lost: deque[int] = field(default_factory=lambda: deque(maxlen=LOSING_S + 1))

    def add(self, stream: Stream) -> None:
        self.ratios.append(stream.rate_hz / stream.expected_hz if stream.expected_hz > 0 else 0.0)
        self.lost.append(stream.lost)

    @property
    def losing(self) -> bool:
        """Whether losses grew during the last seconds. A counter that restarted does not count."""
        return len(self.lost) > 1 and self.lost[-1] > min(self.lost)


@dataclass
class History:
    """The past of every stream by (sensor, stream)."""

    streams: dict[tuple[str, str], StreamHistory] = field(default_factory=dict)
    _sampled_s: float = field(default=float("-inf"))

    def add(self, status: Status, now_s: float) -> None:
        """Take a sample if a second has passed since the last one."""
        if now_s - self._sampled_s < 0.95:
            return
        self._sampled_s = now_s
        for sensor in status.sensors:
            for stream in sensor.streams:
                self.of(sensor.name, stream.name).add(stream)

    def of(self, sensor: str, stream: str) -> StreamHistory:
        return self.streams.setdefault((sensor, stream), StreamHistory())
