"""Sentences of one instant gathered into one epoch, whatever their order, with the date put to its time of day."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.messages import FixQuality
from drivers.reach.sentences import Gga, Gst, Record, Rmc, Zda
from drivers.reach.utc import DAY_MS, nearest_ms

SILENT_SHARE = 0.8
"""Share of a period without data after which an epoch is complete: the last sentence of a burst is not known."""
CARRY_MS = 2500
"""Oldest GST that still speaks for a later epoch."""
PERSISTENT = 3
"""So many epochs in a row that contradict the time or date so far are believed."""


@dataclass(frozen=True, slots=True)
class Instant:
    """The receiver's UTC and when its first byte arrived (monotonic).

    A leap second has the UTC of the second after it, as POSIX time has.
    """

    utc_ns: int
    receive_ns: int
    leap_second: bool


@dataclass(frozen=True, slots=True)
class Epoch:
    """What one instant's sentences said. A GGA without time (no fix, no time) makes an epoch without UTC."""

    receive_ns: int
    """Monotonic, first byte of the first sentence."""
    instant: Instant | None
    """None when the receiver did not know the time."""
    date_assumed: bool
    gga: Gga
    rmc: Rmc | None
    gst: Gst | None
    gst_age_ms: int
    """0: the GST is of this epoch. Later epochs of the same quality carry it on."""


@dataclass
class EpochCounts:
    """What happened to the stream of epochs since the start."""

    duplicates: int = 0
    backwards: int = 0
    missing: int = 0
    """Epochs the receiver's own rhythm says should have come."""
    without_position: int = 0
    """Instants with RMC, GST or ZDA and no GGA."""
    steps: int = 0
    """Times the receiver's UTC went back and stayed there."""
    date_conflicts: int = 0


@dataclass
class _Draft:
    """The epoch being gathered. time_ms None: a GGA without time."""

    time_ms: int | None
    receive_ns: int
    gga: Gga | None = None
    rmc: Rmc | None = None
    gst: Gst | None = None
    zda: Zda | None = None

    def trusted_date_ms(self) -> int | None:
        """A receiver without a fix may still be counting from a date of its own."""
        if self.rmc is not None and self.rmc.active and self.rmc.date_ms is not None:
            return self.rmc.date_ms
        has_fix = self.gga is not None and self.gga.quality is not FixQuality.INVALID
        return self.zda.date_ms if self.zda is not None and has_fix else None


@dataclass(frozen=True)
class _Accepted:
    """The last epoch that counted. Its UTC is in ms since 1970, on the best date known then."""

    time_ms: int
    receive_ns: int
    utc_ms: int
    quality: FixQuality


@dataclass(frozen=True)
class _CarriedGst:
    gst: Gst
    utc_ms: int
    quality: FixQuality


@dataclass
class EpochBuilder:
    """Gathers records into epochs. An epoch closes when the time of day changes, or after a silence.

    period_ms: expected period, until the stream shows its own. host_utc_ns: where the date is taken from until a
    sentence gives it.
    """

    period_ms: int
    host_utc_ns: Callable[[], int] = time.time_ns
    counts: EpochCounts = field(default_factory=EpochCounts)
    date_known: bool = False
    _open: _Draft | None = None
    _open_utc_ms: int | None = None
    _heard_ns: int = 0
    _last: _Accepted | None = None
    _carried: _CarriedGst | None = None
    _rhythm: deque[int] = field(default_factory=lambda: deque(maxlen=10))
    _behind: int = 0
    _conflicts: int = 0

    def add(self, record: Record, receive_ns: int) -> Epoch | None:
        """Take one record; the epoch that it closed, if it closed one."""
        self.heard(receive_ns)
        if not isinstance(record, Gga | Rmc | Gst | Zda):
            return None
        if record.time_ms is None:
            return self._start(None, record, receive_ns) if isinstance(record, Gga) else None
        if self._open is not None and self._open.time_ms == record.time_ms:
            self._put(record)
            return None
        if self._is_behind(record.time_ms, receive_ns):
            return self._take_behind(record, receive_ns)
        return self._start(record.time_ms, record, receive_ns)

    def heard(self, receive_ns: int) -> None:
        """A sentence arrived, of whatever type: the burst goes on."""
        self._heard_ns = receive_ns

    def expire(self, now_ns: int) -> Epoch | None:
        """The open epoch, once nothing has been heard for most of a period."""
        if self._open is None or now_ns - self._heard_ns < SILENT_SHARE * self.learned_period_ms * 1e6:
            return None
        return self.flush()

    def flush(self) -> Epoch | None:
        """The open epoch as far as it came: the link is gone, or the driver stops."""
        draft, self._open, self._open_utc_ms = self._open, None, None
        return None if draft is None else self._close(draft)

    @property
    def learned_period_ms(self) -> int:
        """Period of the stream as it is; the expected one before two epochs came."""
        return min(self._rhythm, default=self.period_ms)

    @property
    def opened(self) -> Instant | None:
        """Instant of the open epoch, where its date is already beyond doubt."""
        if self._open is None or self._open_utc_ms is None or self._open.time_ms is None:
            return None
        return Instant(self._open_utc_ms * 1_000_000, self._open.receive_ns, self._open.time_ms >= DAY_MS)

    def _start(self, time_ms: int | None, record: Gga | Rmc | Gst | Zda, receive_ns: int) -> Epoch | None:
        closed = self.flush()
        self._open = _Draft(time_ms, receive_ns)
        self._put(record)
        date_ms = self._open.trusted_date_ms()
        if time_ms is not None and self.date_known:
            self._open_utc_ms = nearest_ms(time_ms, self._reference_ms(receive_ns))
        elif time_ms is not None and date_ms is not None:
            self._open_utc_ms = date_ms + time_ms
        return closed

    def _put(self, record: Gga | Rmc | Gst | Zda) -> None:
        """The first sentence of a type counts; talkers may repeat it (GN and GP)."""
        assert self._open is not None
        name = type(record).__name__.lower()
        if getattr(self._open, name) is not None:
            self.counts.duplicates += isinstance(record, Gga)
            return
        setattr(self._open, name, record)
        if isinstance(record, Gga):
            self._behind = 0

    def _is_behind(self, time_ms: int, receive_ns: int) -> bool:
        if self._open is not None and self._open.time_ms is not None:
            return _delta_ms(time_ms, receive_ns, self._open.time_ms, self._open.receive_ns) <= 0
        return self._last is not None and _delta_ms(time_ms, receive_ns, self._last.time_ms, self._last.receive_ns) <= 0

    def _take_behind(self, record: Gga | Rmc | Gst | Zda, receive_ns: int) -> Epoch | None:
        """A sentence from the past: late, repeated, out of order, or the receiver's time went back for good."""
        if isinstance(record, Gst) and self._last is not None and record.time_ms == self._last.time_ms:
            self._carried = _CarriedGst(record, self._last.utc_ms, self._last.quality)
        if not isinstance(record, Gga):
            return None
        if self._last is not None and record.time_ms == self._last.time_ms:
            self.counts.duplicates += 1
            return None
        self.counts.backwards += 1
        self._behind += 1
        if self._behind < PERSISTENT:
            return None
        self.counts.steps += 1
        closed = self._start(record.time_ms, record, receive_ns)
        self._last_stepped(record, receive_ns)
        return closed

    def _last_stepped(self, record: Gga, receive_ns: int) -> None:
        """Count on from just before this epoch."""
        assert record.time_ms is not None
        utc_ms = nearest_ms(record.time_ms, self._reference_ms(receive_ns))
        self._last = _Accepted(record.time_ms - 1, receive_ns - 1_000_000, utc_ms - 1, record.quality)
        self._rhythm.clear()
        self._behind = 0

    def _close(self, draft: _Draft) -> Epoch | None:
        if draft.gga is None:
            self.counts.without_position += 1
            return None
        if draft.time_ms is None:
            return Epoch(draft.receive_ns, None, not self.date_known, draft.gga, draft.rmc, None, 0)
        utc_ms = self._resolve(draft, draft.time_ms)
        self._count_missing(draft.time_ms, draft.receive_ns)
        self._last = _Accepted(draft.time_ms, draft.receive_ns, utc_ms, draft.gga.quality)
        if draft.gst is not None:
            self._carried = _CarriedGst(draft.gst, utc_ms, draft.gga.quality)
        gst, age_ms = self._gst_for(draft.gga.quality, utc_ms)
        instant = Instant(utc_ms * 1_000_000, draft.receive_ns, draft.time_ms >= DAY_MS)
        return Epoch(draft.receive_ns, instant, not self.date_known, draft.gga, draft.rmc, gst, age_ms)

    def _resolve(self, draft: _Draft, time_ms: int) -> int:
        """UTC in ms. A date that contradicts the known one has to persist: at midnight some dates lag their time."""
        predicted_ms = nearest_ms(time_ms, self._reference_ms(draft.receive_ns))
        date_ms = draft.trusted_date_ms()
        if date_ms is None:
            return predicted_ms
        if self.date_known and date_ms + time_ms != predicted_ms:
            self.counts.date_conflicts += 1
            self._conflicts += 1
            if self._conflicts < PERSISTENT:
                return predicted_ms
        self._conflicts = 0
        self.date_known = True
        return date_ms + time_ms

    def _reference_ms(self, receive_ns: int) -> int:
        """About what UTC it is: the last epoch and the time since, or the host's clock."""
        if self._last is None:
            return self.host_utc_ns() // 1_000_000
        return self._last.utc_ms + (receive_ns - self._last.receive_ns) // 1_000_000

    def _count_missing(self, time_ms: int, receive_ns: int) -> None:
        """A step of the receiver's time leaves no hole in the host's, and the other way round: the lesser counts."""
        if self._last is None:
            return
        delta_ms = _delta_ms(time_ms, receive_ns, self._last.time_ms, self._last.receive_ns)
        elapsed_ms = (receive_ns - self._last.receive_ns) // 1_000_000
        period_ms = self.learned_period_ms
        self.counts.missing += max(round(min(delta_ms, elapsed_ms) / period_ms) - 1, 0)
        if delta_ms > 1:
            self._rhythm.append(delta_ms)

    def _gst_for(self, quality: FixQuality, utc_ms: int) -> tuple[Gst | None, int]:
        """GST of this epoch or a recent one. After a change of quality an old GST would lie."""
        carried = self._carried
        if carried is None or carried.quality is not quality:
            return None, 0
        age_ms = utc_ms - carried.utc_ms
        return (carried.gst, age_ms) if 0 <= age_ms <= CARRY_MS else (None, 0)


def _delta_ms(time_ms: int, receive_ns: int, before_ms: int, before_receive_ns: int) -> int:
    """From one time of day to a later one: the host's elapsed time says how many midnights lie between."""
    elapsed_ms = (receive_ns - before_receive_ns) / 1e6
    raw_ms = time_ms - before_ms
    midnights = round((elapsed_ms - raw_ms) / DAY_MS)
    leap_ms = 1000 if midnights > 0 and before_ms >= DAY_MS > time_ms else 0
    return raw_ms + midnights * DAY_MS + leap_ms
