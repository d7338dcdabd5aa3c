"""A HERO8 as its HTTP interface shows it: state, answers and oddities, without any socket."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from urllib.parse import SplitResult, parse_qs, urlsplit

from drivers.sim.gopro_replies import Reply, accepted, refused

FREEZE_S = 24.75
"""Picture without keep-alive."""
BOOT_S = 4.0
READY_S = 1.0
BUSY_S = 0.3
BATTERY_LIFE_S = 5400.0
CARD_KB = 31_121_632
RECORDING_KB_S = 5_600
"""45 Mbit/s."""
MODES = {1000: 12, 1001: 17, 1002: 13}
"""Preset group to flat mode (status 89)."""


@dataclass(frozen=True, slots=True)
class Quirks:
    """How this camera misbehaves."""

    model_name: str = "HERO8 Black"
    firmware: str = "HD8.01.02.51.00"
    always_busy: bool = False
    """Busy never clears, and commands are refused: seen after a photo."""
    refuses_recording: bool = False
    webcam_starts: int = 1
    """START calls until webcam mode streams."""
    webcam_ignores_settings: bool = True
    preview_survives_shutter: bool = False
    frozen_after_s: float = FREEZE_S


@dataclass(slots=True)
class _State:
    """What a reboot resets."""

    booted_s: float
    busy_until_s: float = 0.0
    recording_since_s: float | None = None
    stream_to: str | None = None
    webcam: int = 0
    webcam_starts: int = 0
    group: int = 1001
    heard_s: float = 0.0


@dataclass(slots=True)
class _Memory:
    """What survives a reboot."""

    settings: dict[str, int] = field(
        default_factory=lambda: {
            "2": 1,
            "3": 8,
            "51": 1,
            "54": 1,
            "59": 4,
            "62": 0,
            "64": 0,
            "75": 3,
            "83": 0,
            "135": 1,
        }
    )
    videos: int = 0
    used_kb: int = 0
    clock: datetime = datetime(2016, 1, 1)
    clock_set_s: float = 0.0


class Hero8:
    """One camera. Times are seconds of the injected clock. Not thread-safe: the emulator locks."""

    def __init__(self, now: Callable[[], float], quirks: Quirks | None = None) -> None:
        self._now = now
        self.quirks = quirks or Quirks()
        self._state = _State(now() - BOOT_S - READY_S)
        self._memory = _Memory()
        self._first_s = now()
        self._streams = 0
        self.requests: deque[str] = deque(maxlen=1000)
        """Paths asked, for tests."""

    def reboot(self) -> None:
        """Off and on: everything but the card and the settings is lost."""
        self._end_recording()
        self._state = _State(self._now())

    @property
    def up(self) -> bool:
        """On the network."""
        return self._now() - self._state.booted_s >= BOOT_S

    @property
    def recording(self) -> bool:
        """On its card."""
        return self._state.recording_since_s is not None

    @property
    def webcam(self) -> int:
        """0 off, 1 idle, 2 streaming."""
        return self._state.webcam

    @property
    def stream_to(self) -> str | None:
        """Where pictures go now: nowhere once nobody kept them alive."""
        if self._state.stream_to is None or not self.up:
            return None
        frozen = self._now() - self._state.heard_s > self.quirks.frozen_after_s
        return None if frozen else self._state.stream_to

    @property
    def streams(self) -> int:
        """How many times a stream was started."""
        return self._streams

    @property
    def settings(self) -> dict[str, int]:
        """By id."""
        return dict(self._memory.settings)

    @property
    def date(self) -> datetime:
        """The camera's own clock."""
        return self._memory.clock + timedelta(seconds=self._now() - self._memory.clock_set_s)

    def heard(self, datagram: bytes) -> None:
        """A datagram on UDP 8554. Only the HERO8's own keep-alive counts."""
        if datagram.startswith(b"_GPHD_:1:0:2:"):
            self._state.heard_s = self._now()

    def stop_recording(self) -> None:
        """The camera gives up by itself."""
        self._end_recording()

    def ask(self, target: str, requester: str) -> Reply:
        """Answer one GET."""
        self.requests.append(target)
        url = urlsplit(target)
        query = {key: values[-1] for key, values in parse_qs(url.query, keep_blank_values=True).items()}
        parts = [part for part in url.path.split("/") if part]
        match parts:
            case ["gp", "gpControl"]:
                return accepted({"version": 4.0, "schema_version": 5, "info": self._info()})
            case ["gp", "gpControl", "status"]:
                return Reply(200, self._status())
            case ["gp", "gpControl", *rest]:
                return self._control(rest, url, query, requester)
            case ["gp", "gpWebcam", call]:
                return self._webcam(call, query, requester)
            case ["gp", "gpMediaList"]:
                return accepted({"id": "1", "media": [{"d": "100GOPRO", "fs": self._files()}]})
        return Reply(404, b"{}")

    def _control(self, rest: list[str], url: SplitResult, query: dict[str, str], requester: str) -> Reply:
        match rest:
            case ["command", *command]:
                return self._command("/".join(command), url.query, query)
            case ["setting", key, value]:
                return self._setting(key, value)
            case ["execute"]:
                return self._execute(url.path, url.query, query, requester)
        return Reply(404, b"{}")

    def _info(self) -> dict[str, object]:
        return {
            "model_number": 50,
            "model_name": self.quirks.model_name,
            "firmware_version": self.quirks.firmware,
            "serial_number": "C3331350000123",
            "board_type": "0x05",
            "ap_mac": "0641690a0b0c",
            "ap_ssid": "GP-emulated",
            "ap_has_default_credentials": "0",
            "capabilities": "1",
        }

    def _busy(self) -> bool:
        state, now = self._state, self._now()
        return self.quirks.always_busy or now < state.busy_until_s or now - state.booted_s < BOOT_S + READY_S

    def _work(self) -> None:
        self._state.busy_until_s = self._now() + BUSY_S

    def _command(self, command: str, raw_query: str, query: dict[str, str]) -> Reply:
        path = f"/gp/gpControl/command/{command}"
        if self._busy() or (command == "shutter" and self._state.webcam):
            return refused(path, raw_query)
        match command:
            case "shutter":
                return self._shutter(query.get("p") == "1", path, raw_query)
            case "set_mode" if query.get("p", "").isdecimal() and int(query["p"]) in MODES and not self.recording:
                self._state.group = int(query["p"])
            case "setup/date_time":
                return self._set_date(raw_query, path)
            case "system/locate" | "system/sleep" | "storage/tag_moment":
                pass
            case _:
                return refused(path, raw_query)
        self._work()
        return Reply(200, b"{}\n")

    def _shutter(self, on: bool, path: str, raw_query: str) -> Reply:
        if on and (self.quirks.refuses_recording or self._state.group != 1000):
            return refused(path, raw_query)
        if on and not self.recording:
            self._state.recording_since_s = self._now()
        elif not on:
            self._end_recording()
        if not self.quirks.preview_survives_shutter:
            self._state.stream_to = None
        self._work()
        return Reply(200, b"{}\n")

    def _end_recording(self) -> None:
        since_s = self._state.recording_since_s
        if since_s is None:
            return
        self._memory.videos += 1
        self._memory.used_kb += int((self._now() - since_s) * RECORDING_KB_S)
        self._state.recording_since_s = None

    def _set_date(self, raw_query: str, path: str) -> Reply:
        pairs = raw_query.partition("p=")[2].split("%")[1:]
        if len(pairs) != 6 or any(len(pair) != 2 for pair in pairs):
            return refused(path, raw_query)
        try:
            year, *rest = (int(pair, 16) for pair in pairs)
            self._memory.clock = datetime(2000 + year, *rest)  # type: ignore[arg-type]
        except ValueError:
            return refused(path, raw_query)
        self._memory.clock_set_s = self._now()
        return Reply(200, b"{}\n")

    def _setting(self, key: str, value: str) -> Reply:
        if self._busy() or self.recording or key not in self._memory.settings or not value.isdecimal():
            return refused(f"/gp/gpControl/setting/{key}/{value}", "")
        if not (self._state.webcam and self.quirks.webcam_ignores_settings):
            self._memory.settings[key] = int(value)
        return Reply(200, b"{}\n")

    def _execute(self, path: str, raw_query: str, query: dict[str, str], requester: str) -> Reply:
        if query.get("a1") == "proto_v2" or query.get("p1") != "gpStream" or self._state.webcam:
            return refused(path, raw_query)
        if self.quirks.always_busy:
            return refused(path, raw_query)
        if query.get("c1") == "restart":
            self._stream_to(requester)
        elif query.get("c1") == "stop":
            self._state.stream_to = None
        else:
            return refused(path, raw_query)
        return Reply(200, b'{"status":"0"}\n')

    def _stream_to(self, requester: str) -> None:
        self._state.stream_to, self._state.heard_s = requester, self._now()
        self._streams += 1

    def _webcam(self, call: str, query: dict[str, str], requester: str) -> Reply:
        state = self._state
        match call:
            case "START":
                state.webcam_starts += 1
                if state.webcam_starts < self.quirks.webcam_starts or query.get("res", "12") not in {"4", "7", "12"}:
                    state.webcam = 1
                    return accepted({"status": 1, "error": 1})
                state.webcam = 2
                self._stream_to(requester)
            case "STOP":
                state.webcam, state.stream_to = min(state.webcam, 1), None
            case "EXIT":
                state.webcam, state.stream_to = 0, None
            case "SETTINGS" | "STATUS":
                pass
            case _:
                return Reply(200, b"")
        return accepted({"status": state.webcam, "error": 0})

    def _status(self) -> bytes:
        state, memory, now = self._state, self._memory, self._now()
        recorded_s = 0 if state.recording_since_s is None else int(now - state.recording_since_s)
        free_kb = CARD_KB - memory.used_kb - recorded_s * RECORDING_KB_S
        percent = max(1, 76 - int((now - self._first_s) / BATTERY_LIFE_S * 100))
        date = self.date
        stamp = (date.year - 2000, date.month, date.day, date.hour, date.minute, date.second)
        status: dict[str, object] = {
            "1": 1, "2": percent // 30, "3": 0, "4": 255, "6": 0, "8": int(self._busy()), "9": 0,
            "10": int(self.recording), "13": recorded_s, "17": 1, "19": 0, "20": 0, "29": "", "30": "GP-emulated",
            "31": 1, "32": int(state.stream_to is not None), "33": 0, "34": free_kb // 7000,
            "35": free_kb // RECORDING_KB_S, "36": 0, "37": 0, "38": 0, "39": memory.videos,
            "40": "".join(f"%{part:02X}" for part in stamp), "54": free_kb, "55": 1, "56": 4,
            "57": int((now - state.booted_s) * 1000), "60": 500, "64": 2171, "68": 0, "69": 1, "70": percent, "71": 12,
            "72": 17, "73": 24, "76": 1, "77": 1, "79": 0, "81": 1,
            "82": int(now - state.booted_s >= BOOT_S + READY_S), "83": 1, "85": 0, "86": 0, "89": MODES[state.group],
            "90": 1, "93": 2, "94": 65536, "95": 131072, "96": state.group, "97": 65536, "99": 1259, "102": 0,
        }  # fmt: skip
        # A HERO8 breaks its lines, and leaves raw line breaks inside its strings.
        text = json.dumps({"status": status, "settings": memory.settings}, indent=1)
        return text.replace("GP-emulated", "GP-emulated\n").encode()

    def _files(self) -> list[dict[str, str]]:
        return [{"n": f"GH01{n + 1:04d}.MP4", "cre": "0", "mod": "0", "s": "0"} for n in range(self._memory.videos)]
