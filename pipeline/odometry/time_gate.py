"""Keeps messages out whose stamps leap, until so many agree that time itself must have leapt.

One sample stamped an hour ahead would otherwise make everything that follows it too late.
"""

from __future__ import annotations

from typing import Generic, TypeVar

from drivers.messages import ImuSample, LidarScan

Message = TypeVar("Message", LidarScan, ImuSample)
LEAP_NS = 5_000_000_000
"""Longer than the usual silences; what is nearer to the newest stamp goes through at once."""
BELIEVED_NS = 2_000_000_000
"""Leapt stamps that go on for so long among themselves are the time."""


class TimeGate(Generic[Message]):
    """For messages of one kind. Not thread-safe."""

    def __init__(self) -> None:
        self.refused = 0
        """Messages that were left out, for nothing bore out their stamps."""
        self.leapt_ns = 0
        """By how much time leapt with the last message, 0 when it went on."""
        self.newest_ns: int | None = None
        self._told = 0
        self._held: list[Message] = []

    def admit(self, message: Message, other_ns: int | None = None) -> list[Message]:
        """What may go on now, in order of arrival: the message, nothing yet, or all that was held back.

        other_ns: newest stamp of another sensor with the same clock, which bears out a leap ahead.
        """
        stamp_ns, newest_ns, self.leapt_ns = message.stamp_ns, self.newest_ns, 0
        if newest_ns is None:
            self.newest_ns = stamp_ns
            return [message]
        if self._held and abs(stamp_ns - self._held[-1].stamp_ns) > LEAP_NS:
            self._refuse_held()
        ahead_ns = stamp_ns - max(newest_ns, other_ns if other_ns is not None else newest_ns)
        goes_on = ahead_ns <= LEAP_NS and stamp_ns >= newest_ns - LEAP_NS
        self._held.append(message)
        if not goes_on and abs(stamp_ns - self._held[0].stamp_ns) < BELIEVED_NS:
            return []
        believed, self._held = self._held, []
        if goes_on:
            self.newest_ns = max(stamp_ns, newest_ns)
        else:
            self.newest_ns = max(one.stamp_ns for one in believed)
            self.leapt_ns = self.newest_ns - newest_ns
        return believed

    def newly_refused(self) -> int:
        """Messages left out since the last call."""
        since, self._told = self.refused - self._told, self.refused
        return since

    def _refuse_held(self) -> None:
        self.refused += len(self._held)
        self._held.clear()
