"""Whether the recorder really gets on. Systemd's watchdog is fed from this, never from a blind timer.

A single silent receiver turns the health red and no more: the other sensors are still being recorded. Only when the
writer hangs, or every receiver that claims to deliver stands still, is a restart better than going on.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

WRITER_STALL_S = 12.0
"""Consumer cards freeze for 4-7 s at times (recorder.md 1.3); that must not restart anything."""
STOPPING_STALL_S = 45.0
"""Finishing a session on a slow card."""
RECEIVER_STALL_S = 15.0


@dataclass(frozen=True)
class Receiver:
    """A driver: whether it claims to deliver, and its count of messages."""

    name: str
    delivers: bool
    received: int


@dataclass
class Progress:
    """Remembers when each receiver last got on."""

    _seen: dict[str, tuple[int, int]] = field(default_factory=dict)
    """name -> (count, host time it last changed)."""

    def stuck_receivers(self, receivers: Iterable[Receiver], now_ns: int) -> tuple[list[str], bool]:
        """Those that claim to deliver and have not for a while, and whether that is all who claim to."""
        claiming = [receiver for receiver in receivers if self._note(receiver, now_ns)]
        stuck = [one.name for one in claiming if now_ns - self._seen[one.name][1] > RECEIVER_STALL_S * 1e9]
        return stuck, bool(stuck) and len(stuck) == len(claiming)

    def _note(self, receiver: Receiver, now_ns: int) -> bool:
        known = self._seen.get(receiver.name)
        if known is None or known[0] != receiver.received or not receiver.delivers:
            self._seen[receiver.name] = (receiver.received, now_ns)
        return receiver.delivers


def writer_stall_s(last_progress_ns: int, now_ns: int) -> float:
    """How long the writer has given no sign of life."""
    return max(0.0, (now_ns - last_progress_ns) / 1e9)
