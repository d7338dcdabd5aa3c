"""Health codes of the LiDAR (parameter 0x8011) in words, with what to do about each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

_COOL = "shade the LiDAR and let air flow around it"
_RESTART = "switch the payload off and on; when it comes back, have the LiDAR serviced"
_TIME = "check the time synchronisation; the recording maps the LiDAR's clock by itself meanwhile"
SCAN_MODULE = range(0x0210, 0x021A)

TEXTS: dict[int, tuple[str, str]] = {
    0x0102: ("ambient temperature slightly high", _COOL),
    0x0103: ("ambient temperature rather high", _COOL),
    0x0104: ("window dirty, or something within 0.1 m", "clean the window, clear what stands in front of it"),
    0x0105: ("firmware upgrade failed", "repeat the upgrade with Livox Viewer"),
    0x0111: ("internal temperature out of range", _COOL),
    0x0112: ("internal temperature out of range", _COOL),
    0x0113: ("IMU stopped", _RESTART),
    0x0114: ("ambient temperature high", _COOL),
    0x0115: ("ambient temperature beyond the limit, stopped", _COOL),
    0x0116: ("supply voltage out of range", "check battery and cable: 9 to 27 V"),
    0x0117: ("internal parameters wrong", _RESTART),
    0x0118: ("internal damage", _RESTART),
    0x0201: ("scan module heating up", "wait; below 0 degC this takes up to 10 minutes"),
    **dict.fromkeys(SCAN_MODULE, ("scan module abnormal", "wait; when it does not recover by itself, restart it")),
    0x0401: ("network link was down, recovered", "check the Ethernet cable and its plugs"),
    0x0402: ("PTP stopped or jumped", _TIME),
    0x0403: ("PTP master of version 2.1 is not supported", "set the master to IEEE 1588-2008 (v2.0)"),
    0x0404: ("PPS synchronisation abnormal", _TIME),
    0x0405: ("time synchronisation exception", _TIME),
    0x0406: ("time synchronisation inaccurate", _TIME),
    0x0407: ("no GPS data for synchronisation", ""),
    0x0408: ("no PPS for synchronisation", _TIME),
    0x0409: ("GPS data for synchronisation abnormal", _TIME),
    0x040A: ("PTP and gPTP masters both present", "leave only one of the two running"),
}
NEVER_A_FAULT = {0x0407}
"""Units without GPS wired show it on and off (reference sheet, section 4)."""


class Level(IntEnum):
    """How bad it is, in the device's own words."""

    INFO = 1
    WARNING = 2
    ERROR = 3
    FATAL = 4


@dataclass(frozen=True, slots=True)
class Finding:
    """One health code, explained."""

    code: int
    level: int
    text: str
    advice: str

    @property
    def fault(self) -> bool:
        """Whether the operator should hear of it."""
        return self.level >= Level.WARNING and self.code >> 16 not in NEVER_A_FAULT


def explain(code: int) -> Finding:
    """A code, id << 16 | level, in words. Unknown ids are named by their number."""
    ident, level = code >> 16, code & 0xFF
    text, advice = TEXTS.get(ident, (f"health code {ident:#06x}", "see the manual of the LiDAR"))
    if ident in SCAN_MODULE and level >= Level.FATAL:
        advice = _RESTART
    return Finding(code, level, text, advice)


def worst(codes: Iterable[int]) -> Finding | None:
    """The gravest fault among the codes of a status push, None when there is none."""
    faults = [finding for finding in map(explain, codes) if finding.code and finding.fault]
    return max(faults, key=lambda finding: finding.level, default=None)
