"""The Reach receiver as a sensor: keeps a link open, records every sentence, and makes one fix an epoch."""

from __future__ import annotations

import logging
import math
import threading
import time

from drivers.clock import ClockState
from drivers.driver import Emit, SensorHealth, StreamHealth
from drivers.errors import ProtocolError, SensorUnreachable
from drivers.messages import GnssFix, NmeaSentence, SensorEvent, Severity
from drivers.reach.config import Config, TcpEndpoint, parse_endpoint
from drivers.reach.epoch import Epoch, EpochBuilder, Instant
from drivers.reach.fix import fix_of
from drivers.reach.framing import Frame, Framer, Rejection
from drivers.reach.health import Arrivals, View, fix_details, judge
from drivers.reach.sentences import Ebp, Record, parse
from drivers.reach.timing import ReceiverClock
from drivers.reach.transport import Link, open_link

_log = logging.getLogger(__name__)

READ_TIMEOUT_S = 0.1
DAMAGED = (Rejection.BAD_CHECKSUM, Rejection.INTERRUPTED, Rejection.TOO_LONG)
"""Rejections that mean a sentence was lost; the others are mostly binary protocols between sentences."""


class Sensor:
    """Driver of one Reach (see `drivers.driver.Driver`). `health` may be called from another thread than `run`."""

    def __init__(self, name: str, config: Config) -> None:
        self.name = name
        self._config = config
        self._endpoint = parse_endpoint(config.endpoint)
        self._framer = Framer()
        self._builder = EpochBuilder(round(1000.0 / config.rate_hz))
        self._clock = ReceiverClock(round(config.latency_ms * 1e6))
        self._lock = threading.Lock()
        """Guards everything below, which `health` reads."""
        self._sentences = Arrivals()
        self._fixes = Arrivals()
        self._link_problem = f"looking for {config.endpoint}: wait, or check cable and power"
        self._link_address = ""
        self._open_ns = 0
        self._link_bytes = 0
        self._link_sentences = 0
        self._malformed = 0
        self._fix: GnssFix | None = None
        self._base: Ebp | None = None
        self._utc_minus_host_s: float | None = None
        self._clock_state: ClockState | None = None
        self._judged_damaged = 0
        self._judged_sentences = 0

    def run(self, emit: Emit, stop: threading.Event) -> None:
        """Receive until `stop` is set, opening the link anew whenever it goes."""
        while not stop.is_set():
            try:
                link = open_link(self._endpoint, self._config.baud, stop)
            except SensorUnreachable as error:
                self._note_unreachable(str(error))
                stop.wait(self._config.reconnect_s)
                continue
            self._note_open(link)
            try:
                self._receive(link, emit, stop)
            except SensorUnreachable as error:
                self._note_unreachable(str(error))
                if self._link_sentences:
                    self._tell(emit, Severity.WARNING, str(error))
                stop.wait(self._config.reconnect_s)
            finally:
                link.close()
                self._finish(self._builder.flush(), emit)

    def health(self) -> SensorHealth:
        """Rates, losses, state and advice since the last call."""
        now_ns = time.monotonic_ns()
        with self._lock:
            view = self._view(now_ns)
            state, problem, advice = judge(view, self._config)
            return SensorHealth(
                name=self.name,
                state=state,
                streams=(self._fix_stream(now_ns), self._sentence_stream(now_ns)),
                clock=self._clock_state,
                problem=problem,
                advice=advice,
                details=self._details(),
            )

    def session_started(self) -> None:
        """Nothing to do: the receiver always sends."""

    def session_stopped(self) -> None:
        """Nothing to do."""

    def _receive(self, link: Link, emit: Emit, stop: threading.Event) -> None:
        heard_ns = time.monotonic_ns()
        while not stop.is_set():
            data = link.read(READ_TIMEOUT_S)
            now_ns = time.monotonic_ns()
            if data:
                heard_ns = now_ns
                self._take_bytes(data, now_ns, emit)
                self._builder.heard(now_ns)
            elif isinstance(self._endpoint, TcpEndpoint) and now_ns - heard_ns > self._config.silence_s * 1e9:
                raise SensorUnreachable(f"{link.address} has been silent for {self._config.silence_s:g} s")
            self._finish(self._builder.expire(now_ns), emit)

    def _take_bytes(self, data: bytes, receive_ns: int, emit: Emit) -> None:
        with self._lock:
            self._link_bytes += len(data)
            frames = self._framer.feed(data, receive_ns)
        for frame in frames:
            self._take_sentence(frame, emit)

    def _take_sentence(self, frame: Frame, emit: Emit) -> None:
        record = self._parse(frame)
        if self._link_sentences == 1:  # said here and not at the opening: a port that opens and closes would flood
            self._tell(emit, Severity.INFO, f"receiving from {self._link_address}")
        if record is None:
            self._builder.heard(frame.receive_ns)
        else:
            self._finish(self._builder.add(record, frame.receive_ns), emit)
        instant = self._builder.opened
        stamp_ns = frame.receive_ns if instant is None else self._stamp(instant, False, emit)
        emit(NmeaSentence(stamp_ns, frame.receive_ns, frame.sentence))

    def _parse(self, frame: Frame) -> Record | None:
        try:
            record = parse(frame.sentence)
        except ProtocolError as error:
            _log.debug("%s", error)
            record = None
            malformed = 1
        else:
            malformed = 0
        with self._lock:
            self._malformed += malformed
            self._link_sentences += 1
            self._sentences.note(frame.receive_ns)
            if isinstance(record, Ebp):
                self._base = record
        return record

    def _finish(self, epoch: Epoch | None, emit: Emit) -> None:
        if epoch is None:
            return
        instant = epoch.instant
        stamp_ns = epoch.receive_ns if instant is None else self._stamp(instant, epoch.date_assumed, emit)
        fix = fix_of(epoch, stamp_ns)
        with self._lock:
            self._fix = fix
            self._fixes.note(epoch.receive_ns)
            self._clock_state = self._clock.state()
            if instant is not None:
                self._utc_minus_host_s = _utc_minus_host_s(instant)
        emit(fix)

    def _stamp(self, instant: Instant, date_assumed: bool, emit: Emit) -> int:
        stamp_ns, step = self._clock.stamp(instant, date_assumed)
        if step is not None:
            text = f"the receiver's UTC stepped by {-step.jump_ns / 1e9:+.3f} s against the host's clock"
            self._tell(emit, Severity.WARNING, text)
        return stamp_ns

    def _note_open(self, link: Link) -> None:
        with self._lock:
            self._framer.reset()
            self._link_problem, self._link_address = "", link.address
            self._open_ns = time.monotonic_ns()
            self._link_bytes = self._link_sentences = 0

    def _note_unreachable(self, problem: str) -> None:
        with self._lock:
            if problem != self._link_problem:
                _log.warning("%s: %s", self.name, problem)
            self._link_problem = problem

    def _tell(self, emit: Emit, severity: Severity, text: str) -> None:
        now_ns = time.monotonic_ns()
        emit(SensorEvent(now_ns, now_ns, self.name, severity, text))

    def _view(self, now_ns: int) -> View:
        damaged = sum(self._framer.rejected[reason] for reason in DAMAGED) + self._malformed
        new_damaged, new_good = damaged - self._judged_damaged, self._sentences.received - self._judged_sentences
        self._judged_damaged, self._judged_sentences = damaged, self._sentences.received
        fix_ns = self._fixes.last_ns
        return View(
            link_problem=self._link_problem,
            open_s=(now_ns - self._open_ns) / 1e9,
            link_bytes=self._link_bytes,
            link_sentences=self._link_sentences,
            fix=self._fix,
            fix_silence_s=math.inf if fix_ns is None else (now_ns - fix_ns) / 1e9,
            recent_hz=self._fixes.recent_hz(now_ns, self._open_ns),
            damaged_share=new_damaged / max(new_damaged + new_good, 1),
            address=self._link_address,
        )

    def _fix_stream(self, now_ns: int) -> StreamHealth:
        rate_hz, gap_s = self._fixes.look(now_ns)
        lost = self._builder.counts.missing
        return StreamHealth("fix", rate_hz, self._config.rate_hz, self._fixes.received, lost, gap_s)

    def _sentence_stream(self, now_ns: int) -> StreamHealth:
        rate_hz, gap_s = self._sentences.look(now_ns)
        return StreamHealth("nmea", rate_hz, 0.0, self._sentences.received, self._judged_damaged, gap_s)

    def _details(self) -> dict[str, str]:
        details = {"address": self._link_address or self._config.endpoint}
        if self._fix is not None:
            details |= fix_details(self._fix)
        if self._utc_minus_host_s is not None:
            details["utc_minus_host_s"] = f"{self._utc_minus_host_s:+.2f}"
        if self._base is not None and self._base.position_deg is not None:
            details["base"] = "{:.8f} {:.8f}".format(*self._base.position_deg)
        details |= {f"rejected {reason.value}": str(n) for reason, n in _counts(self._framer) if n}
        details |= {name: str(n) for name, n in vars(self._builder.counts).items() if n}
        return details


def _counts(framer: Framer) -> list[tuple[Rejection, int]]:
    return [(reason, framer.rejected[reason]) for reason in Rejection]


def _utc_minus_host_s(instant: Instant) -> float:
    """A whole number of seconds off tells a receiver that does not know the leap seconds, or a host clock not set."""
    host_utc_ns = time.time_ns() - (time.monotonic_ns() - instant.receive_ns)
    return (instant.utc_ns - host_utc_ns) / 1e9
