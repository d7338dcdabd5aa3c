"""The datagram that tells the camera that somebody still watches. Without it the picture freezes after some 25 s."""

from __future__ import annotations

KEEP_ALIVE = b"_GPHD_:1:0:2:0.000000\n"
"""HERO8 and HERO9; older models want a 0 in front."""
INTERVAL_S = 2.5


class KeepAlive:
    """When the next one is due, on a monotonic clock in seconds."""

    def __init__(self) -> None:
        self._next_s = 0.0

    def now(self) -> None:
        """Send one at the next opportunity."""
        self._next_s = 0.0

    def due(self, now_s: float) -> bool:
        """True once an interval."""
        if now_s < self._next_s:
            return False
        self._next_s = now_s + INTERVAL_S
        return True
