"""Where every message of every driver goes: the session, the viewers, the last fix."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from drivers.messages import GnssFix
from edge.recording.messages import Recordable

Tap = Callable[[Recordable], None]
"""Takes a message at once; never blocks and never raises."""


class OfferedTo(Protocol):
    """What the intake needs of a session: `SessionRecorder` is one."""

    def offer(self, message: Recordable) -> None:
        """Take a message; never blocks and never raises."""


class Intake:
    """Called from every driver thread, 200 times a second and more: it hands over, and does nothing else."""

    def __init__(self, taps: tuple[Tap, ...] = ()) -> None:
        self._taps = taps
        self.session: OfferedTo | None = None
        """The session being recorded. Set by the service; reading and writing it is atomic."""
        self.last_fix: GnssFix | None = None

    def take(self, message: Recordable) -> None:
        """Hand a message to all who want it. Any thread."""
        session = self.session
        if session is not None:
            session.offer(message)
        if type(message) is GnssFix:
            self.last_fix = message
        for tap in self._taps:
            tap(message)
