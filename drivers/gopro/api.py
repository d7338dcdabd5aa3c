"""The camera's HTTP commands ("gpControl"). Each call is one bounded exchange that answers or raises.

SensorUnreachable: no answer in time, or the link broke. SensorRefused: HTTP 500 or another no.
ProtocolError: an answer that is not what the camera sends. Section 2 and 5 of the reference sheet.
"""

from __future__ import annotations

import http.client
import json
import time
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from drivers.errors import ProtocolError, SensorRefused, SensorUnreachable, SensorUnsupported

VIDEO_GROUP = 1000
MODEL = "HERO8"
REPLY_LIMIT = 1 << 20
RESOLUTIONS = {1080: 12, 720: 7, 480: 4}
"""Spelled out (`res=1080`) the value is silently ignored."""
FIELDS_OF_VIEW = {"wide": 0, "narrow": 2, "superview": 3, "linear": 4}


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """Who the camera says it is."""

    model: str
    firmware: str
    serial: str


@dataclass(frozen=True, slots=True)
class WebcamState:
    """Answer of every webcam call. HTTP 200 alone is no success: streaming is status 2 with error 0."""

    status: int
    error: int

    STREAMING = 2
    ERRORS = (
        "none",
        "set-preset",
        "set-window",
        "exec-stream",
        "shutter",
        "timeout",
        "bad parameter",
        "unavailable",
        "exit",
    )

    @property
    def streaming(self) -> bool:
        """Pictures should be on their way."""
        return self.status == self.STREAMING and self.error == 0

    @property
    def words(self) -> str:
        """For people."""
        error = self.ERRORS[self.error] if 0 <= self.error < len(self.ERRORS) else "unknown"
        return f"status {self.status}, error {self.error} ({error})"


class Camera:
    """One camera at one address. Stateless: every call opens its own connection, as a HERO8 wants it."""

    def __init__(self, address: str, port: int = 80, source: str = "", timeout_s: float = 5.0) -> None:
        """source: local address to ask from; the camera streams to it."""
        self.address = address
        self._port = port
        self._source = (source, 0) if source else None
        self.timeout_s = timeout_s

    def identify(self) -> CameraInfo:
        """Name, firmware, serial number. SensorUnsupported when it is another model."""
        info = self._ask("/gp/gpControl").get("info")
        if not isinstance(info, dict):
            raise SensorUnsupported(f"{self.address}: answers gpControl without saying what it is; not a HERO8")
        found = CameraInfo(*(str(info.get(key, "")) for key in ("model_name", "firmware_version", "serial_number")))
        if MODEL not in found.model.upper():
            raise SensorUnsupported(
                f"{self.address}: this is a {found.model or 'camera without a name'} (firmware {found.firmware}); "
                "the driver speaks to a HERO8 Black"
            )
        return found

    def status(self) -> dict[str, Any]:
        """Status and settings, ids as strings."""
        return self._ask("/gp/gpControl/status")

    def shutter(self, on: bool) -> None:
        """Start or stop recording on the card."""
        self._ask(f"/gp/gpControl/command/shutter?p={int(on)}")

    def set_group(self, group: int) -> None:
        """Preset group: 1000 video, 1001 photo, 1002 time-lapse."""
        self._ask(f"/gp/gpControl/command/set_mode?p={group}")

    def set_setting(self, setting: str, value: int) -> None:
        """One setting. Refused in modes that do not have it."""
        self._ask(f"/gp/gpControl/setting/{setting}/{value}")

    def set_clock(self, now: datetime) -> None:
        """Date and time, whole seconds, no zone."""
        self._ask(f"/gp/gpControl/command/setup/date_time?p={clock_text(now)}")

    def preview(self, start: bool) -> None:
        """Start (again) or stop the preview stream. Never with a1=proto_v2: a HERO8 answers 500."""
        self._ask(f"/gp/gpControl/execute?p1=gpStream&c1={'restart' if start else 'stop'}")

    def webcam_start(self, resolution: int, port: int) -> WebcamState:
        """Enter webcam mode and stream to `port`. resolution: 480, 720 or 1080."""
        return self._webcam(f"START?res={RESOLUTIONS[resolution]}&port={port}")

    def webcam_settings(self, fov: str) -> WebcamState:
        """Field of view, to be sent after START."""
        return self._webcam(f"SETTINGS?fov={FIELDS_OF_VIEW[fov]}")

    def webcam_status(self) -> WebcamState:
        """Upper case on purpose: `status` gets an empty reply."""
        return self._webcam("STATUS")

    def webcam_stop(self) -> WebcamState:
        """Stop streaming, stay in webcam mode."""
        return self._webcam("STOP")

    def webcam_exit(self) -> WebcamState:
        """Leave webcam mode."""
        return self._webcam("EXIT")

    def _webcam(self, call: str) -> WebcamState:
        answer = self._ask(f"/gp/gpWebcam/{call}")
        try:
            return WebcamState(int(answer["status"]), int(answer.get("error", 0)))
        except (KeyError, TypeError, ValueError) as error:
            raise ProtocolError(f"{self.address}: gpWebcam/{call} answered {answer!r:.200}") from error

    def _ask(self, path: str) -> dict[str, Any]:
        code, body = self._exchange(path)
        if code == http.client.OK:
            return self._parse(path, body)
        raise SensorRefused(f"{self.address}: {path} refused with HTTP {code}{_reason(body)}")

    def _exchange(self, path: str) -> tuple[int, bytes]:
        connection = http.client.HTTPConnection(
            self.address, self._port, timeout=self.timeout_s, source_address=self._source
        )
        deadline = time.monotonic() + self.timeout_s
        try:
            connection.request("GET", path, headers={"Connection": "close"})
            response = connection.getresponse()
            return response.status, _read(response, deadline)
        except OSError as error:
            raise SensorUnreachable(f"{self.address}:{self._port} does not answer {path}: {error}") from error
        except (http.client.HTTPException, ValueError) as error:
            raise ProtocolError(f"{self.address}:{self._port} answered {path} with no HTTP: {error!r}") from error
        finally:
            connection.close()

    def _parse(self, path: str, body: bytes) -> dict[str, Any]:
        if not body.strip():
            return {}
        try:
            # Not strict: the camera leaves raw line breaks in its JSON.
            answer = json.loads(body.decode("utf-8", "replace"), strict=False)
        except (ValueError, RecursionError) as error:
            raise ProtocolError(f"{self.address}: {path} answered no JSON: {body[:80]!r}") from error
        if not isinstance(answer, dict):
            raise ProtocolError(f"{self.address}: {path} answered no JSON object: {body[:80]!r}")
        return answer


def clock_text(now: datetime) -> str:
    """Six bytes as two-digit hex each: year since 2000, month, day, hour, minute, second."""
    parts = (now.year - 2000, now.month, now.day, now.hour, now.minute, now.second)
    return "".join(f"%{part:02X}" for part in parts)


def _read(response: http.client.HTTPResponse, deadline: float) -> bytes:
    """The body, bounded in time and size: a socket timeout alone starts anew with each byte."""
    parts: list[bytes] = []
    size = 0
    while chunk := response.read1(65536):
        parts.append(chunk)
        size += len(chunk)
        if time.monotonic() > deadline:
            raise TimeoutError("the answer did not end in time")
        if size > REPLY_LIMIT:
            raise ValueError(f"more than {REPLY_LIMIT} bytes")
    return b"".join(parts)


def _reason(body: bytes) -> str:
    """The camera's own word, out of the error JSON that comes with HTTP 500."""
    try:
        answer = json.loads(body.decode("utf-8", "replace"), strict=False)
    except (ValueError, RecursionError):
        return ""
    if not isinstance(answer, dict) or "error_code" not in answer:
        return ""
    return f": error {answer['error_code']} {answer.get('error_msg', '')}".rstrip()
