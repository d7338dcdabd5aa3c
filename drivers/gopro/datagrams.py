"""Datagrams put right before they become a stream: copies and rubbish out, a swapped neighbour back in its place.

A transport stream has no sequence number but the 4-bit continuity counter of each PID. That is enough to hold one
datagram back when it does not fit, and to see whether the next one does.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

PACKET = 188
_SYNC = b"\x47" * 64
REMEMBERED = 16
UNALIGNED_LIMIT = 32
"""So many datagrams in a row that are not whole packets are no rubbish: the sender cuts its stream elsewhere."""

Arrival = tuple[bytes, int]
"""Bytes and the host time of their arrival, ns."""


@dataclass(slots=True)
class DatagramCounts:
    """What was seen since the start."""

    received: int = 0
    duplicates: int = 0
    rubbish: int = 0
    reordered: int = 0


class DatagramOrder:
    """Between the socket and the demuxer. `video_pid` is to be set once the demuxer knows it."""

    def __init__(self) -> None:
        self.counts = DatagramCounts()
        self.video_pid: int | None = None
        self._recent: deque[bytes] = deque(maxlen=REMEMBERED)
        self._held: Arrival | None = None
        self._counter: int | None = None
        self._aligned = False
        self._unaligned_run = 0

    def accept(self, datagram: bytes, receive_ns: int) -> list[Arrival]:
        """Take one datagram in, give those that are in order now."""
        self.counts.received += 1
        if datagram in self._recent:
            self.counts.duplicates += 1
            return []
        self._recent.append(datagram)
        if not _whole_packets(datagram):
            return self._unaligned(datagram, receive_ns)
        self._aligned, self._unaligned_run = True, 0
        return self._order((datagram, receive_ns))

    def release(self) -> list[Arrival]:
        """Nothing more comes for now: give what was held back."""
        held, self._held = self._held, None
        return [] if held is None else [self._passed(held)]

    def restart(self) -> None:
        """A new stream begins: its counters are its own."""
        self._held, self._counter = None, None

    def _unaligned(self, datagram: bytes, receive_ns: int) -> list[Arrival]:
        self._unaligned_run += 1
        if self._unaligned_run > UNALIGNED_LIMIT:
            self._aligned = False
        if self._aligned:
            self.counts.rubbish += 1
            return []
        return [*self.release(), (datagram, receive_ns)]

    def _order(self, arrival: Arrival) -> list[Arrival]:
        if self._fits(arrival[0]):
            if self._held is None:
                return [self._passed(arrival)]
            self.counts.reordered += 1
            return [self._passed(arrival), *self.release()]
        if self._held is None:
            self._held = arrival
            return []
        return [*self.release(), self._passed(arrival)]

    def _fits(self, datagram: bytes) -> bool:
        first = self._counters(datagram)[0]
        return first is None or self._counter is None or first == (self._counter + 1) & 0x0F

    def _passed(self, arrival: Arrival) -> Arrival:
        last = self._counters(arrival[0])[1]
        if last is not None:
            self._counter = last
        return arrival

    def _counters(self, datagram: bytes) -> tuple[int | None, int | None]:
        """First and last continuity counter of the video in a datagram."""
        pid, first, last = self.video_pid, None, None
        if pid is None:
            return None, None
        for at in range(0, len(datagram), PACKET):
            if (datagram[at + 1] & 0x1F) << 8 | datagram[at + 2] == pid and datagram[at + 3] & 0x10:
                last = datagram[at + 3] & 0x0F
                first = last if first is None else first
        return first, last


def _whole_packets(datagram: bytes) -> bool:
    count, rest = divmod(len(datagram), PACKET)
    return count > 0 and rest == 0 and datagram[::PACKET] == _SYNC[:count]
