"""Configuration of the camera."""

from __future__ import annotations

from typing import Literal

import msgspec


class Config(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the camera is reached and what it is told to do."""

    mode: Literal["wifi", "usb"] = "wifi"
    """wifi: preview stream, and the camera records on its own card. usb: webcam stream, no recording on the card."""
    address: str = ""
    """Empty: 10.5.5.9 on Wi-Fi; on USB found by `serial` or by the USB vendor id."""
    serial: str = ""
    """Serial number, or its last three digits. They make the camera's USB address."""
    http_port: int = 80
    stream_port: int = 8554
    host: str = ""
    """Address of this computer towards the camera. Empty: whichever the route has."""
    record_on_camera: bool = True
    """Start and stop the camera's own recording with the session (Wi-Fi only)."""
    set_clock: bool = True
    """Set the camera's clock to UTC when it is reached."""
    settings: dict[str, int] = msgspec.field(default_factory=lambda: {"59": 0, "83": 1, "135": 0})
    """Setting id to value, forced when the camera is reached: never off, GPS on, stabilisation off."""
    webcam_resolution: Literal[480, 720, 1080] = 1080
    webcam_fov: Literal["wide", "linear", "narrow", "superview"] = "wide"
    expected_hz: float = 29.97
    latency_ms: float = 0.0
    """Constant delay from exposure to the first datagram, found by calibration; stamps are put back by it."""
    timeout_s: float = 5.0
    """Bound of one HTTP exchange."""
    poll_s: float = 1.0
    """Between two status requests; the camera asks for no less than 0.5."""
    stall_s: float = 4.0
    """Silence of the stream after which it is started again."""
    retry_s: float = 3.0
    """Between two attempts to reach the camera."""
    low_battery_percent: int = 15
    low_card_s: int = 600
    """Remaining recording time on the card that is worth a warning."""

    @property
    def poll_interval_s(self) -> float:
        """Never faster than 2 Hz, whatever was asked."""
        return max(self.poll_s, 0.5)
