"""One key for start and stop, proof against a slip."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

CONFIRM_S = 3.0
"""The second press must come within this time."""
BOUNCE_S = 0.25
"""Presses closer together than this are one press: a glove that bounces, or a held key repeating."""
REST_S = 3.0
"""After a stop the key does not start again for this long: a third press is part of the same slip."""


class Press(Enum):
    """What a press of the key means."""

    NOTHING = "nothing"
    START = "start"
    ARM = "arm"
    """The first press while recording: ask for the second."""
    STOP = "stop"
    REST = "rest"
    """Would start, but a stop was just asked for."""


@dataclass
class StopGuard:
    """Decides what a press means. Times are seconds of any one monotonic clock."""

    _last_press_s: float = field(default=float("-inf"))
    _armed_s: float = field(default=float("-inf"))
    _stopped_s: float = field(default=float("-inf"))

    def press(self, now_s: float, state: str) -> Press:
        """The key was pressed while the recorder's state was `state` (idle, recording, stopping)."""
        bounced = now_s - self._last_press_s < BOUNCE_S
        self._last_press_s = now_s
        if bounced or state == "stopping":
            return Press.NOTHING
        if state == "recording":
            return self._while_recording(now_s)
        return Press.REST if now_s - self._stopped_s < REST_S else Press.START

    def armed_for_s(self, now_s: float) -> float:
        """Seconds left in which one more press stops; 0 when none would."""
        return max(0.0, self._armed_s + CONFIRM_S - now_s)

    def disarm(self) -> None:
        self._armed_s = float("-inf")

    def _while_recording(self, now_s: float) -> Press:
        if self.armed_for_s(now_s) > 0:
            self.disarm()
            self._stopped_s = now_s
            return Press.STOP
        self._armed_s = now_s
        return Press.ARM
