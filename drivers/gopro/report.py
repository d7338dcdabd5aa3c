"""What the driver's threads know, put together for the operator."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

from drivers.clock import ClockState
from drivers.driver import SensorHealth, SensorState, StreamHealth
from drivers.gopro.api import CameraInfo
from drivers.gopro.status import CameraStatus, Trouble

SLOW = 0.9
"""Share of the expected rate below which the operator should know."""


@dataclass(slots=True)
class Report:
    """Written by the control thread, read by `health`. Each field is replaced whole, under `lock`."""

    phase: SensorState = SensorState.SEARCHING
    trouble: Trouble | None = None
    """What keeps the camera from being used at all."""
    info: CameraInfo | None = None
    status: CameraStatus | None = None
    address: str = ""
    silence: Trouble | None = None
    """Why no stream comes, once starting it again has not helped."""
    warnings: tuple[Trouble, ...] = ()
    lock: threading.Lock = field(default_factory=threading.Lock)

    def set(self, phase: SensorState, trouble: Trouble | None = None) -> None:
        """Enter a phase."""
        with self.lock:
            self.phase, self.trouble = phase, trouble

    def starting(self) -> None:
        """Reached again. What was wrong before stays on the screen until it turns out to be over."""
        with self.lock:
            self.trouble = self.trouble if self.phase is SensorState.FAILED else None
            self.phase = SensorState.STARTING

    def health(
        self, name: str, stream: StreamHealth, flowing: bool, clock: ClockState | None, facts: dict[str, str]
    ) -> SensorHealth:
        """flowing: frames are coming now."""
        with self.lock:
            phase, trouble, warnings, status = self.phase, self.trouble, self.warnings, self.status
            silence = self.silence
            details = {**self._facts(), **facts}
        state = phase
        if phase is SensorState.OK:
            if flowing:
                slow = _slow(stream)
                warnings = (*warnings, slow) if slow else warnings
                state = SensorState.DEGRADED if warnings else SensorState.OK
            else:
                trouble = silence
                state = SensorState.FAILED if silence else SensorState.STARTING
        shown = trouble or (warnings[0] if warnings else None)
        return SensorHealth(
            name=name,
            state=state,
            streams=(stream,),
            clock=clock,
            problem=shown.problem if shown else "",
            advice=shown.advice if shown else "",
            battery_percent=status.battery_percent if status else None,
            details=details,
        )

    def _facts(self) -> dict[str, str]:
        facts = {"address": self.address}
        if self.info:
            facts |= {"model": self.info.model, "firmware": self.info.firmware, "serial": self.info.serial}
        if self.status is None:
            return facts
        facts["camera recording"] = "yes" if self.status.recording else "no"
        facts["card"] = self.status.card
        if self.status.card_free_bytes is not None:
            facts["card free"] = f"{self.status.card_free_bytes / 1e9:.1f} GB"
        if self.status.card_remaining_s is not None:
            facts["card remaining"] = f"{self.status.card_remaining_s // 60} min"
        return facts


def _slow(stream: StreamHealth) -> Trouble | None:
    if stream.rate_hz >= SLOW * stream.expected_hz:
        return None
    return Trouble(
        f"Camera delivers {stream.rate_hz:.1f} of {stream.expected_hz:.1f} frames a second.",
        "Bring the antennas closer together, or use USB.",
    )
