"""Rate and silence of one stream between two looks at it."""

from __future__ import annotations

from threading import Lock


class RateMeter:
    """Marked by the thread that receives, read by the one that watches."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._last_ns: int | None = None
        self._previous_ns: int | None = None
        self._since = 0
        self._gap_ns = 0
        self.total = 0

    @property
    def last_ns(self) -> int | None:
        """Reception of the newest message."""
        return self._last_ns

    def mark(self, *receive_ns: int) -> None:
        """Messages came, at these times in order."""
        with self._lock:
            for at_ns in receive_ns:
                if self._last_ns is None:
                    self._previous_ns = at_ns
                else:
                    self._gap_ns = max(self._gap_ns, at_ns - self._last_ns)
                    self._since += 1
                self._last_ns = at_ns
            self.total += len(receive_ns)

    def read(self, now_ns: int) -> tuple[float, float]:
        """Rate (Hz) over the messages, and longest silence (s), since the last call; a lasting silence counts."""
        with self._lock:
            if self._last_ns is None or self._previous_ns is None:
                return 0.0, 0.0
            elapsed_ns = self._last_ns - self._previous_ns
            rate_hz = self._since * 1e9 / elapsed_ns if elapsed_ns > 0 else 0.0
            gap_ns = max(self._gap_ns, now_ns - self._last_ns)
            self._previous_ns, self._since, self._gap_ns = self._last_ns, 0, 0
            return rate_hz, gap_ns / 1e9
