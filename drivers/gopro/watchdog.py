"""Watches the stream for silence, starts it again, and after three tries says where to look."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.gopro.status import Trouble

TRIES = 3
LATER_S = 10.0
"""Between attempts after the first three."""
NO_PICTURE_S = 10.0
"""Datagrams without a frame for so long: no keyframe, or no video in the stream."""


@dataclass(frozen=True, slots=True)
class StreamSigns:
    """Monotonic seconds of the newest datagram and frame, 0 when there was none yet."""

    datagram_s: float
    frame_s: float


class Watchdog:
    """Times are monotonic seconds."""

    def __init__(self, stall_s: float, port: int) -> None:
        self._stall_s = stall_s
        self._port = port
        self._started_s = 0.0
        self._tries = 0

    def started(self, now_s: float) -> None:
        """The stream was asked for just now."""
        self._started_s = now_s

    def starved(self, now_s: float, signs: StreamSigns) -> bool:
        """Whether to start the stream again. Counts as a try when it says so."""
        if signs.frame_s > self._started_s:
            self._tries = 0
        waited_s = now_s - self._started_s
        silent = now_s - max(signs.datagram_s, self._started_s) > self._patience_s()
        blind = min(now_s - signs.frame_s, waited_s) > NO_PICTURE_S
        if not silent and not blind:
            return False
        self._tries += 1
        return True

    def trouble(self, now_s: float, signs: StreamSigns, camera_streams: bool | None) -> Trouble | None:
        """What to tell the operator, once starting again has not helped."""
        if self._tries < TRIES:
            return None
        if now_s - signs.datagram_s < self._stall_s:
            return Trouble("The camera's stream has no picture to start from.", "Switch the camera off and on.")
        nothing = f"nothing arrives on UDP port {self._port}"
        if camera_streams is False:
            return Trouble(f"The camera does not stream: {nothing}, and it says so too.", "Switch it off and on.")
        return Trouble(
            f"The camera says that it streams, and {nothing}.",
            f"Open {self._port}/udp in this computer's firewall, and check the route to the camera.",
        )

    def _patience_s(self) -> float:
        return self._stall_s if self._tries < TRIES else max(self._stall_s, LATER_S)
