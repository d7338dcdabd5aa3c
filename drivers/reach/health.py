"""What the operator is told about the receiver: one word, what is wrong, and what to do about it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from drivers.driver import SensorState
from drivers.messages import QUALITY_NAMES, FixQuality, GnssFix
from drivers.reach.config import Config
from drivers.reach.covariance import SOURCE_TABLE

STALE_PERIODS = 3.0
LOST_S = 5.0
"""Silent for so long, the receiver is being looked for, not just late."""
FIRST_SENTENCE_S = 3.0
DAMAGED_SHARE = 0.01
LOW_RATE = 0.7
RATE_WINDOW_NS = 5_000_000_000


class Arrivals:
    """Arrivals of one kind: rate and longest silence since the last look, rate over the last seconds."""

    def __init__(self) -> None:
        self.received = 0
        self.last_ns: int | None = None
        self._recent: deque[int] = deque()
        self._largest_gap_ns = 0
        self._looked_ns: int | None = None
        self._looked_received = 0

    def note(self, receive_ns: int) -> None:
        if self.last_ns is not None:
            self._largest_gap_ns = max(self._largest_gap_ns, receive_ns - self.last_ns)
        self.last_ns = receive_ns
        self.received += 1
        self._recent.append(receive_ns)
        self._forget(receive_ns)

    def look(self, now_ns: int) -> tuple[float, float]:
        """(rate in Hz, longest silence in s) since the last look, a silence that goes on included."""
        elapsed_ns = 0 if self._looked_ns is None else now_ns - self._looked_ns
        rate_hz = (self.received - self._looked_received) / elapsed_ns * 1e9 if elapsed_ns > 0 else 0.0
        gap_ns = max(self._largest_gap_ns, 0 if self.last_ns is None else now_ns - self.last_ns)
        self._looked_ns, self._looked_received, self._largest_gap_ns = now_ns, self.received, 0
        return rate_hz, gap_ns / 1e9

    def recent_hz(self, now_ns: int, since_ns: int) -> float | None:
        """Rate over the last seconds; None until the link has been open for so long."""
        self._forget(now_ns)
        return len(self._recent) / RATE_WINDOW_NS * 1e9 if now_ns - since_ns >= RATE_WINDOW_NS else None

    def _forget(self, now_ns: int) -> None:
        while self._recent and self._recent[0] <= now_ns - RATE_WINDOW_NS:
            self._recent.popleft()


@dataclass(frozen=True, slots=True)
class View:
    """What the judgement is made from. Times in seconds before now; `fix` is the last epoch, whatever its quality."""

    link_problem: str
    """Why there is no link; empty when it is open."""
    open_s: float
    link_bytes: int
    link_sentences: int
    fix: GnssFix | None
    fix_silence_s: float
    recent_hz: float | None
    damaged_share: float
    address: str


Judgement = tuple[SensorState, str, str]
"""State, problem, advice."""


def judge(view: View, config: Config) -> Judgement:
    """The worst of what is wrong."""
    if view.link_problem:
        problem, _, advice = view.link_problem.partition(": ")
        return SensorState.SEARCHING, problem, advice or "check cable, power and endpoint"
    return _no_epochs(view, config) or _bad_fix(view, config) or _bad_stream(view, config) or (SensorState.OK, "", "")


def _no_epochs(view: View, config: Config) -> Judgement | None:
    if view.link_sentences == 0:
        return _no_sentences(view)
    silence_s = min(view.fix_silence_s, view.open_s)
    if silence_s <= max(STALE_PERIODS / config.rate_hz, 0.5):
        return None if view.fix is not None else (SensorState.STARTING, "", "")
    if view.fix is None:
        advice = "switch GGA on in the position output of the receiver"
        return SensorState.DEGRADED, "NMEA without GGA: no positions", advice
    state = SensorState.DEGRADED if silence_s < LOST_S else SensorState.SEARCHING
    return state, f"no epoch for {silence_s:.1f} s", "check cable and power of the receiver, or wait while it starts"


def _no_sentences(view: View) -> Judgement:
    if view.open_s < FIRST_SENTENCE_S:
        return SensorState.STARTING, "", ""
    if view.link_bytes == 0:
        advice = "switch the position output of the receiver to NMEA on this port"
        return SensorState.STARTING, f"{view.address} is open and silent", advice
    advice = "set the position output to NMEA, and the same baud rate on both sides"
    return SensorState.DEGRADED, f"{view.link_bytes} bytes, and no NMEA sentence among them", advice


def _bad_fix(view: View, config: Config) -> Judgement | None:
    fix = view.fix
    if fix is None:
        return None
    if fix.quality is FixQuality.INVALID:
        advice = "give the antenna a free view of the sky, and check its cable"
        return SensorState.DEGRADED, f"no fix ({fix.satellites} satellites)", advice
    if fix.quality is FixQuality.SINGLE:
        advice = "check the correction input of the receiver (NTRIP, radio)"
        return SensorState.DEGRADED, "single fix: metres, no corrections", advice
    if fix.age_s is not None and fix.age_s > config.correction_age_limit_s:
        advice = "check the link to the base (NTRIP, radio): the fix is about to be lost"
        return SensorState.DEGRADED, f"corrections are {fix.age_s:.0f} s old", advice
    return None


def _bad_stream(view: View, config: Config) -> Judgement | None:
    if view.damaged_share > DAMAGED_SHARE:
        advice = "check the cable, lower the baud rate, or switch GSV and GSA off"
        return SensorState.DEGRADED, f"{view.damaged_share:.0%} of the sentences are damaged", advice
    if view.recent_hz is not None and view.recent_hz < LOW_RATE * config.rate_hz:
        advice = "set GGA, RMC and GST to the same rate, the GNSS rate no lower, or correct rate_hz"
        return SensorState.DEGRADED, f"{view.recent_hz:.1f} epochs a second instead of {config.rate_hz:g}", advice
    if view.fix is not None and view.fix.sigma_source == SOURCE_TABLE:
        return SensorState.DEGRADED, "no GST: sigmas are guessed", "switch GST on, at the rate of GGA"
    return None


def fix_details(fix: GnssFix) -> dict[str, str]:
    """The last fix in words."""
    east_m, north_m, up_m = fix.sigma_enu_m
    details = {
        "quality": QUALITY_NAMES[fix.quality],
        "satellites": str(fix.satellites),
        "sigma_source": fix.sigma_source,
        "date": "assumed" if fix.date_assumed else "received",
    }
    if math.isfinite(east_m):
        details["sigma_horizontal_m"] = f"{math.hypot(east_m, north_m):.3f}"
        details["sigma_vertical_m"] = f"{up_m:.3f}"
    if math.isfinite(fix.hdop):
        details["hdop"] = f"{fix.hdop:.1f}"
    if fix.age_s is not None:
        details["correction_age_s"] = f"{fix.age_s:.1f}"
    return details
