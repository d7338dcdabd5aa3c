"""Situations as a payload in the field produces them: for screenshots, and for trying the screen without a recorder."""

from __future__ import annotations

from typing import Any, TypeVar

import msgspec

from edge.control.messages import Clock, Gnss, Host, Recording, Sensor, Status, Stream, Verdict

SESSION = "20260901T081502Z_north-slope"
STAMP_NS = 1_788_250_502_000_000_000

Struct = TypeVar("Struct", bound=msgspec.Struct)


def _changed(value: Struct, changes: dict[str, Any]) -> Struct:
    return msgspec.structs.replace(value, **changes)


def livox(**changes: Any) -> Sensor:
    streams = (Stream("lidar", 10.0, 10.0, 7540, 0, 0.101), Stream("imu", 200.1, 200.0, 150_812, 0, 0.008))
    return _changed(Sensor("livox", "ok", streams, Clock(0.31, 12.4, 0.2, 0), temperature_c=52.0), changes)


def reach(**changes: Any) -> Sensor:
    streams = (Stream("fix", 5.0, 5.0, 3770, 0, 0.205), Stream("nmea", 30.0, 30.0, 22_620, 0, 0.18))
    return _changed(Sensor("reach", "ok", streams, Clock(2.1, 0.4, 4.0, 0), battery_percent=81.0), changes)


def gopro(**changes: Any) -> Sensor:
    streams = (Stream("video", 29.97, 29.97, 22_590, 3, 0.041),)
    return _changed(Sensor("gopro", "ok", streams, Clock(3.8, 31.0, 6.0, 0), battery_percent=63.0), changes)


def gopro_failed() -> Sensor:
    return gopro(
        state="failed",
        streams=(Stream("video", 0.0, 29.97, 22_590, 41, 12.6),),
        battery_percent=4.0,
        problem="No picture for 12 s: the camera switched itself off.",
        advice="Change its battery, switch it on. The recorder finds it again by itself.",
    )


def reach_degraded() -> Sensor:
    return reach(
        state="degraded",
        streams=(Stream("fix", 3.1, 5.0, 3612, 0, 1.4), Stream("nmea", 19.2, 30.0, 21_004, 158, 1.4)),
        problem="158 sentences lost on the serial line.",
        advice="Push the cable in. Keep it away from the camera's antenna.",
    )


HOST = Host(34.0, 41.0, 61.0, False, 41_200_000_000, 7920.0, 5100.0, 0.03, True, "gnss")
GNSS = Gnss(5, "RTK float", 14, 0.21, 0.38, 0.1)
RECORDING = Recording(SESSION, f"/recordings/{SESSION}", "north-slope", 754.0, 2_860_000_000, 207_332, 0, 3, 11.0, 12)
REASONS = (
    "The camera stopped 41 s before the end (/camera/video). Charge its battery and keep a second one at hand.",
    "The GNSS receiver had a fix in 42 % of its epochs only. Let it stand in the open for a minute at the start.",
    "/livox/lidar lost 212 packets (0.02 %), largest gap 0.3 s at 0:04:50.",
    "/gnss/nmea lost 158 sentences between 0:09:01 and 0:09:40.",
)


def recording(*sensors: Sensor, **changes: Any) -> Status:
    return _changed(
        Status(STAMP_NS, "recording", sensors or (livox(), reach(), gopro()), HOST, GNSS, RECORDING), changes
    )


def idle(*sensors: Sensor, **changes: Any) -> Status:
    return _changed(Status(STAMP_NS, "idle", sensors or (livox(), reach(), gopro()), HOST, GNSS), changes)


GOOD = recording()
TROUBLE = recording(
    livox(),
    reach_degraded(),
    gopro_failed(),
    host=Host(71.0, 58.0, 88.0, True, 6_200_000_000, 660.0, 1500.0, 0.56, False, ""),
    gnss=Gnss(1, "single", 7, 4.6, 8.2, 0.3),
)
READY = idle()
PASSED = idle(verdict=Verdict(SESSION, "PASS"))
WARNED = idle(livox(), reach(), gopro_failed(), verdict=Verdict(SESSION, "WARN", REASONS))
