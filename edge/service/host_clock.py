"""The computer's clock: is it disciplined, by what, and does it jump."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

STEP_NS = 20_000_000
"""NTP slews by at most 0.5 ms a second; a reading torn by preemption errs by some ms."""
_TIME_ERROR = 5
_STA_UNSYNC = 0x0040
_STA_NANO = 0x2000


class _Timex(ctypes.Structure):
    """struct timex of adjtimex(2); only its first fields are read."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_char * 256),
    )


@dataclass(frozen=True)
class Discipline:
    """State of the system clock. error_s: the kernel's estimate, None where it does not tell."""

    synchronised: bool
    source: str
    error_s: float | None = None


def discipline(root: Path = Path("/"), adjtimex: Callable[[], tuple[int, int, int] | None] | None = None) -> Discipline:
    """What the kernel says; where a sandbox forbids asking (ProtectClock=), what systemd-timesyncd left in /run."""
    told = (adjtimex or _adjtimex)()
    source = _source(root)
    if told is None:
        synchronised = (root / "run/systemd/timesync/synchronized").exists()
        return Discipline(synchronised, source if synchronised else "unknown")
    state, status, error_us = told
    synchronised = state != _TIME_ERROR and not status & _STA_UNSYNC
    return Discipline(synchronised, source if synchronised else "none", error_us / 1e6)


class StepWatch:
    """Sees the system clock step: UTC minus monotonic time must not change."""

    def __init__(self, read: Callable[[], int] | None = None) -> None:
        """read: UTC minus monotonic, ns."""
        self._read = read or offset_ns
        self.offset_ns = self._read()
        self.steps = 0

    def look(self) -> int:
        """The size of a step since the last look, ns; 0 when there was none."""
        offset = self._read()
        jump = offset - self.offset_ns
        self.offset_ns = offset
        if abs(jump) < STEP_NS:
            return 0
        self.steps += 1
        return jump


def offset_ns() -> int:
    """UTC minus monotonic time now; the tightest of three readings."""
    readings = []
    for _ in range(3):
        before = time.monotonic_ns()
        utc = time.time_ns()
        after = time.monotonic_ns()
        readings.append((after - before, utc - (before + after) // 2))
    return min(readings)[1]


def _adjtimex() -> tuple[int, int, int] | None:
    """(state, status, estimated error in us), None when the kernel does not let us ask."""
    timex = _Timex()
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex))
    except (OSError, AttributeError):
        return None
    return None if state < 0 else (state, timex.status, timex.esterror)


def _source(root: Path) -> str:
    if any((root / place).exists() for place in ("run/chrony/chronyd.pid", "run/chronyd.pid", "run/chrony.pid")):
        return "chrony"
    if (root / "run/systemd/timesync/synchronized").exists():
        return "systemd-timesyncd"
    return "kernel"
