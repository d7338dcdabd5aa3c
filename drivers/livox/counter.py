"""Losses of one stream, from its free-running packet counter cross-checked with its timestamps."""

from __future__ import annotations

from collections import OrderedDict
from enum import Enum
from typing import NamedTuple

WRAP = 1 << 16
LATE = 1024
"""A counter this little behind the newest is a late packet; further off it is a restart or a long loss."""
JUMP_NS = 1_000_000_000
SOON_NS = 400_000_000
"""The next packet within this time needs no closer look."""


class Verdict(Enum):
    """What to make of a packet."""

    NEW = "new"
    LATE = "late"
    """Overtaken by others, and still wanted."""
    DUPLICATE = "duplicate"
    ODD = "odd"
    """Continues nothing. Dropped: either it is damaged, or the next packet confirms a jump or a restart."""
    JUMPED = "jumped"
    """First packet on a new line of time or count."""


class _Arrival(NamedTuple):
    number: int
    sensor_ns: int
    receive_ns: int


class PacketCounter:
    """Counts what one stream lost. `period_ns` is the mean time between two packets."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._last: _Arrival | None = None
        self._odd: _Arrival | None = None
        self._left: _Arrival | None = None
        """Last packet before the last jump: stragglers of that line must not be taken for a jump back."""
        self._missing: OrderedDict[int, None] = OrderedDict()
        self.received = 0
        self.lost = 0
        self.duplicates = 0
        self.late = 0
        self.odd = 0
        self.jumps = 0
        self.restarts = 0

    def take(self, count: int, sensor_ns: int, receive_ns: int) -> Verdict:
        """Judge a packet in order of arrival. `count` is udp_cnt, 0..65535."""
        arrival = _Arrival(count, sensor_ns, receive_ns)
        last = self._last
        if last is None:
            return self._accept(arrival)
        gap = (count - last.number) % WRAP
        if gap == 1 and 0 < sensor_ns - last.sensor_ns < SOON_NS:
            return self._accept(arrival)
        if gap == 0 and sensor_ns == last.sensor_ns:
            self.duplicates += 1
            return Verdict.DUPLICATE
        if WRAP - gap <= LATE and 0 <= last.sensor_ns - sensor_ns <= 2 * LATE * self._period_ns:
            return self._late(count)
        packets = self._packets_between(last, arrival)
        if packets is None:
            return self._judge_odd(arrival)
        if packets > 1:
            self._lose(last.number, packets - 1)
        return self._accept(arrival)

    def _packets_between(self, earlier: _Arrival, later: _Arrival) -> int | None:
        """Packets sent from one arrival to a later one; None when count and time contradict each other."""
        gap = (later.number - earlier.number) % WRAP
        elapsed_ns = later.sensor_ns - earlier.sensor_ns
        ahead_ns = elapsed_ns - (later.receive_ns - earlier.receive_ns)
        if elapsed_ns <= 0 or ahead_ns > JUMP_NS:
            return None
        wraps = max(0 if gap else 1, round((elapsed_ns / self._period_ns - gap) / WRAP))
        if self._fits(gap + wraps * WRAP, elapsed_ns):
            return gap + wraps * WRAP
        return gap if 0 < gap <= LATE else None

    def _fits(self, packets: int, elapsed_ns: int) -> bool:
        """Whether so many packets take this long; oscillator and IMU jitter stay far within the tolerance."""
        return abs(packets - elapsed_ns / self._period_ns) <= 64 + packets // 1000

    def _judge_odd(self, arrival: _Arrival) -> Verdict:
        if self._left is not None and _same_line(self._left, arrival):
            self.odd += 1
            return Verdict.ODD
        odd, last = self._odd, self._last
        self._odd = arrival
        if odd is None or last is None or self._packets_between(odd, arrival) not in range(1, LATE + 1):
            self.odd += 1
            return Verdict.ODD
        self.odd -= 1  # the first packet of the new line was sound after all
        if (odd.number - last.number) % WRAP <= LATE:
            self.jumps += 1
        else:
            self.restarts += 1
        self._missing.clear()
        self._left = last
        self._accept(arrival)
        return Verdict.JUMPED

    def _accept(self, arrival: _Arrival) -> Verdict:
        self._last = arrival
        self._odd = None
        if self._missing:
            self._missing.pop(arrival.number, None)  # of the previous round of the counter
        self.received += 1
        return Verdict.NEW

    def _late(self, count: int) -> Verdict:
        if count not in self._missing:
            self.duplicates += 1
            return Verdict.DUPLICATE
        del self._missing[count]
        self.lost -= 1
        self.late += 1
        self.received += 1
        return Verdict.LATE

    def _lose(self, last_count: int, lost: int) -> None:
        self.lost += lost
        for ahead in range(max(1, lost - LATE + 1), lost + 1):
            self._missing[(last_count + ahead) % WRAP] = None
        while len(self._missing) > LATE:
            self._missing.popitem(last=False)


def _same_line(left: _Arrival, straggler: _Arrival) -> bool:
    """Whether a packet belongs to a line of time that was left less than a second ago."""
    behind = min((straggler.number - left.number) % WRAP, (left.number - straggler.number) % WRAP)
    apart_ns = max(abs(straggler.sensor_ns - left.sensor_ns), abs(straggler.receive_ns - left.receive_ns))
    return behind <= LATE and apart_ns < JUMP_NS
