"""The camera's status numbers as a record, and what to tell the operator about them.

Ids and values: section 3 of the reference sheet. Any key may be missing on a HERO8; that is None, never an error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

VIDEO_FLATMODE = 12
CARD_STATES = {0: "ok", 1: "full", 2: "removed", 3: "format error", 4: "busy", 8: "swapped"}
CARD_ADVICE = {
    "full": "Empty the camera's card or put in another one.",
    "removed": "Put a card into the camera.",
    "format error": "Format the card in the camera.",
    "swapped": "Check the camera's card; it was changed.",
}


@dataclass(frozen=True, slots=True)
class CameraStatus:
    """One answer of the camera."""

    ready: bool
    busy: bool
    recording: bool
    recorded_s: int | None = None
    hot: bool = False
    cold: bool = False
    battery_percent: int | None = None
    card: str = "unknown"
    card_free_bytes: int | None = None
    card_remaining_s: int | None = None
    videos: int | None = None
    streaming: bool | None = None
    gps_lock: bool | None = None
    group: int | None = None
    uptime_ms: int | None = None
    settings: dict[str, int] = field(default_factory=dict)


Condition = Callable[[CameraStatus], bool]


@dataclass(frozen=True, slots=True)
class Trouble:
    """Something the operator should know, and what to do about it."""

    problem: str
    advice: str


def read(answer: Mapping[str, Any]) -> CameraStatus:
    """Typed record of a status answer."""
    status, settings = _table(answer, "status"), _table(answer, "settings")
    free_kb, group = status.get("54"), status.get("96")
    if group is None and status.get("89") == VIDEO_FLATMODE:
        group = 1000
    return CameraStatus(
        ready=status.get("82", 1) == 1,
        busy=status.get("8") == 1,
        recording=status.get("10") == 1,
        recorded_s=status.get("13"),
        hot=status.get("6") == 1,
        cold=status.get("85") == 1,
        battery_percent=_percent(status.get("70")),
        card=CARD_STATES.get(status.get("33", -1), "unknown"),
        card_free_bytes=None if free_kb is None else free_kb * 1024,  # kilobytes, whatever the documents say
        card_remaining_s=status.get("35"),
        videos=status.get("39"),
        streaming=_flag(status.get("32")),
        gps_lock=_flag(status.get("68")),
        group=group,
        uptime_ms=status.get("57"),
        settings=settings,
    )


def troubles(status: CameraStatus, recording_wanted: bool, low_battery_percent: int, low_card_s: int) -> list[Trouble]:
    """What is wrong, worst first. The card matters only where the camera is to record."""
    found: list[Trouble] = []
    if status.hot:
        found.append(Trouble("The camera is too hot and may stop.", "Shade it, give it air, or pause."))
    if recording_wanted and status.card in CARD_ADVICE:
        found.append(Trouble(f"The camera's card: {status.card}.", CARD_ADVICE[status.card]))
    if status.battery_percent is not None and status.battery_percent <= low_battery_percent:
        found.append(Trouble(f"Camera battery at {status.battery_percent} %.", "Change it or connect power."))
    if recording_wanted and status.card == "ok" and _below(status.card_remaining_s, low_card_s):
        found.append(Trouble(f"Camera card full in {status.card_remaining_s} s.", "Change the camera's card."))
    if status.cold:
        found.append(Trouble("The camera is cold; its battery may give in early.", "Keep a warm spare battery."))
    return found


def _table(answer: Mapping[str, Any], key: str) -> dict[str, int]:
    """Only the whole numbers: the rest are names and dates."""
    table = answer.get(key)
    if not isinstance(table, Mapping):
        return {}
    return {str(k): int(v) for k, v in table.items() if isinstance(v, int)}


def _flag(value: int | None) -> bool | None:
    return None if value is None else value == 1


def _percent(value: int | None) -> int | None:
    return value if value is not None and 0 <= value <= 100 else None


def _below(value: int | None, limit: int) -> bool:
    return value is not None and value < limit
