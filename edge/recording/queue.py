"""The queue between the sensors and the writer: bounded in bytes, with room kept for what is small and vital.

When it is full the newest message is lost, and counted. A scan or a video frame is refused earlier than an IMU
sample or a fix: `reserve_percent` of the room is not for it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from threading import Condition

from drivers.messages import LidarScan, NmeaSentence, SensorEvent, VideoFrame
from edge.recording.messages import Diagnostics, Mark, Recordable

_OBJECT_BYTES = 512
"""What a small message weighs in memory with everything that hangs on it; measured 470 for an IMU sample."""
_WAKE_BYTES = 1 << 20


@dataclass(slots=True)
class Drops:
    """Messages of one kind that found no room. Stamps are host time."""

    count: int
    first_ns: int
    last_ns: int

    def add(self, receive_ns: int) -> None:
        self.count += 1
        self.first_ns = min(self.first_ns, receive_ns)
        self.last_ns = max(self.last_ns, receive_ns)


def cost_bytes(message: Recordable) -> int:
    """Memory a message holds while it waits."""
    match message:
        case LidarScan():
            return 2 * _OBJECT_BYTES + message.xyz_m.nbytes + 7 * len(message.xyz_m)
        case VideoFrame():
            return _OBJECT_BYTES + len(message.data)
        case Diagnostics():
            return _OBJECT_BYTES * (1 + sum(1 + len(status.values) for status in message.statuses))
        case NmeaSentence():
            return _OBJECT_BYTES + len(message.sentence)
        case SensorEvent() | Mark():
            return _OBJECT_BYTES + len(message.text)
        case _:
            return _OBJECT_BYTES


class RecordQueue:
    """Any number of threads put, one takes."""

    def __init__(self, capacity_bytes: int, reserve_percent: float) -> None:
        self._capacity = capacity_bytes
        self._bulk_capacity = int(capacity_bytes * (1 - reserve_percent / 100))
        self._messages: deque[tuple[Recordable, int]] = deque()
        self._waiting_bytes = 0
        self._taken_bytes = 0
        self._changed = Condition()
        self._closed = False
        self._drops: dict[type, Drops] = {}
        self._new_drops: dict[type, Drops] = {}

    def put(self, message: Recordable) -> bool:
        """Whether there was room. Never blocks for longer than the lock is held (microseconds)."""
        cost = cost_bytes(message)
        limit = self._bulk_capacity if isinstance(message, LidarScan | VideoFrame) else self._capacity
        with self._changed:
            if self._closed:
                return False
            if self._waiting_bytes + self._taken_bytes + cost > limit:
                self._drop(message)
                return False
            self._messages.append((message, cost))
            self._waiting_bytes += cost
            if self._waiting_bytes >= _WAKE_BYTES > self._waiting_bytes - cost:
                self._changed.notify()
        return True

    def take(self, timeout_s: float, limit_bytes: int = _WAKE_BYTES) -> list[Recordable]:
        """The oldest messages, about `limit_bytes` of them. Those taken before count as written from now on.

        Waits for `timeout_s` even when a little is there: the writer wakes 20 times a second, not once a message.
        """
        with self._changed:
            self._taken_bytes = 0
            if not self._closed and self._waiting_bytes < _WAKE_BYTES:
                self._changed.wait(timeout_s)
            batch = []
            while self._messages and self._taken_bytes < limit_bytes:
                message, cost = self._messages.popleft()
                batch.append(message)
                self._taken_bytes += cost
            self._waiting_bytes -= self._taken_bytes
        return batch

    def close(self) -> None:
        """Refuse what comes from now on, without counting it. What waits can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def closed(self) -> bool:
        return self._closed

    def abandon(self) -> None:
        """Close, and count everything that waits as lost."""
        with self._changed:
            self._closed = True
            for message, _ in self._messages:
                self._drop(message)
            self._messages.clear()
            self._waiting_bytes = self._taken_bytes = 0
            self._changed.notify_all()

    def count_drop(self, message: Recordable) -> None:
        """Count a message that was taken and could not be written."""
        with self._changed:
            self._drop(message)

    def fill(self) -> float:
        """0..1 of the room, what the writer has in hand included."""
        return (self._waiting_bytes + self._taken_bytes) / self._capacity

    def drops(self) -> dict[type, Drops]:
        """Losses by kind since the start."""
        with self._changed:
            return {kind: Drops(one.count, one.first_ns, one.last_ns) for kind, one in self._drops.items()}

    def new_drops(self) -> dict[type, Drops]:
        """Losses by kind since the last call."""
        with self._changed:
            drops, self._new_drops = self._new_drops, {}
        return drops

    def _drop(self, message: Recordable) -> None:
        for drops in (self._drops, self._new_drops):
            kind, at = type(message), message.receive_ns
            drops.setdefault(kind, Drops(0, at, at)).add(at)
