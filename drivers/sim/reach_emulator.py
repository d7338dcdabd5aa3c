"""An emulated Reach M2: solves with a `GnssSource`, and speaks its NMEA over a pseudo-terminal and over TCP.

`run` is the whole life of the receiver, for a process or a thread of its own. Each epoch lies on a round instant of
the receiver's UTC; it leaves `latency_s` later, and takes the time of its bytes on a serial line.
"""

from __future__ import annotations

import heapq
import json
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

from drivers.sim.faults import FaultPlan
from drivers.sim.reach_emulator_faults import LineFaults
from drivers.sim.reach_emulator_nmea import SentenceSet, sentences
from drivers.sim.reach_emulator_ports import BITS_A_BYTE, Port, PseudoTerminal, TcpServer
from drivers.sim.sources import GnssEpoch, GnssSource, StopFlag

SLICE_BYTES = 64
"""Serial bytes reach the host in such pieces (the packet size of USB serial)."""
TICK_S = 0.05
"""Longest nap: stop and the start of a fault are seen this soon."""


@dataclass(frozen=True, slots=True)
class ReachSettings:
    """How the emulated receiver is set up."""

    rate_hz: float = 5.0
    sentences: SentenceSet = field(default_factory=SentenceSet)
    baud: int = 115200
    """Line rate that the pseudo-terminal emulates; 0: as fast as it goes."""
    latency_s: float = 0.03
    """From the instant of measurement to the first byte."""
    boot_s: float = 4.0
    """A reboot takes the links away for so long,"""
    acquire_s: float = 2.0
    """and then there is neither fix nor time for so long."""
    utc_epoch_ns: int | None = None
    """UTC at the shared epoch; None: the host's clock, read once."""
    seed: int = 1


def run(
    source: GnssSource,
    plan: FaultPlan,
    epoch_ns: int,
    stop: StopFlag,
    *,
    pty: Path | None = None,
    tcp: tuple[str, int] | None = None,
    settings: ReachSettings | None = None,
    truth: Path | None = None,
) -> None:
    """Emulate until `stop` is set.

    epoch_ns: monotonic instant at which the walk's t_ns is 0. pty: symbolic link to make to the pseudo-terminal.
    tcp: loopback address and port to listen on. truth: file to append lines of {"host_ns", "sensor_ns"}, one an epoch;
    sensor_ns is the UTC the receiver gives to the monotonic instant host_ns. SimulationError for a bad address.
    """
    settings = settings or ReachSettings()
    ports: list[Port] = []
    if pty is not None:
        ports.append(PseudoTerminal(pty, settings.baud))
    if tcp is not None:
        ports.append(TcpServer(*tcp))
    Receiver(source, plan, epoch_ns, ports, settings).run(stop, truth)


class UtcLine:
    """The receiver's own UTC against the host's monotonic clock: a line with drift and steps, and its inverse."""

    def __init__(self, host_ns: int, utc_ns: int) -> None:
        self._host_ns, self._utc_ns, self._rate = host_ns, utc_ns, 1.0

    def utc_at(self, host_ns: int) -> int:
        return self._utc_ns + round((host_ns - self._host_ns) * self._rate)

    def host_at(self, utc_ns: int) -> int:
        return self._host_ns + round((utc_ns - self._utc_ns) / self._rate)

    def drift(self, host_ns: int, ppm: float) -> None:
        """From `host_ns` on the line has this drift; the time itself does not jump."""
        rate = 1.0 + ppm * 1e-6
        if rate != self._rate:
            self._utc_ns, self._host_ns, self._rate = self.utc_at(host_ns), host_ns, rate

    def step(self, step_ns: int) -> None:
        self._utc_ns += step_ns


class Receiver:
    """The running receiver. `ports` may be looked at from another thread for their addresses."""

    def __init__(
        self, source: GnssSource, plan: FaultPlan, epoch_ns: int, ports: Sequence[Port], settings: ReachSettings
    ) -> None:
        self._source, self._plan, self._epoch_ns, self._settings = source, plan, epoch_ns, settings
        self.ports = ports
        self._period_ns = round(1e9 / settings.rate_hz)
        self._faults = LineFaults(plan, 1.0 / settings.rate_hz, settings.seed)
        utc_ns = settings.utc_epoch_ns
        if utc_ns is None:
            utc_ns = time.time_ns() - (time.monotonic_ns() - epoch_ns)
        self._line = UtcLine(epoch_ns, utc_ns)
        self._queue: list[tuple[int, int, Port, bytes]] = []
        self._queued = 0
        self._free_ns = [0] * len(ports)
        self._down_until_ns = 0
        self._lost_until_ns = 0

    def run(self, stop: StopFlag, truth: Path | None = None) -> None:
        """Until `stop` is set."""
        record = None if truth is None else truth.open("a", encoding="utf-8")
        next_utc_ns = self._next_utc_ns(time.monotonic_ns())
        try:
            while not stop.is_set():
                now_ns = time.monotonic_ns()
                if self._step_clock(now_ns):
                    next_utc_ns = self._next_utc_ns(now_ns)
                self._set_links(now_ns)
                while self._line.host_at(next_utc_ns) <= now_ns:
                    self._solve(next_utc_ns, record)
                    next_utc_ns += self._period_ns
                self._send_due(now_ns)
                self._nap(stop, self._line.host_at(next_utc_ns))
        finally:
            for port in self.ports:
                port.close()
            if record is not None:
                record.close()

    def _t_s(self, host_ns: int) -> float:
        return (host_ns - self._epoch_ns) / 1e9

    def _next_utc_ns(self, host_ns: int) -> int:
        """The next round instant."""
        return (self._line.utc_at(host_ns) // self._period_ns + 1) * self._period_ns

    def _step_clock(self, now_ns: int) -> bool:
        """Follow the clock faults; whether the epochs have to be laid anew."""
        t_s = self._t_s(now_ns)
        self._line.drift(now_ns, self._plan.level("clock_drift", t_s))
        steps = self._plan.due("clock_step", t_s)
        for fault in steps:
            self._line.step(round(fault.value * 1e9))
        return bool(steps)

    def _set_links(self, now_ns: int) -> None:
        """Links come and go with a reboot or a disconnect; what is on its way then is lost."""
        t_s = self._t_s(now_ns)
        if self._plan.due("reboot", t_s):
            self._down_until_ns = now_ns + round(self._settings.boot_s * 1e9)
            self._lost_until_ns = self._down_until_ns + round(self._settings.acquire_s * 1e9)
        if now_ns < self._down_until_ns or self._plan.active("disconnect", t_s):
            self._queue.clear()
            for port in self.ports:
                port.close()
        else:
            for port in self.ports:
                port.open()

    def _solve(self, utc_ns: int, record: TextIO | None) -> None:
        """One epoch: solve, write the truth, put the burst on its way."""
        host_ns = self._line.host_at(utc_ns)
        t_s = self._t_s(host_ns)
        if record is not None:
            record.write(json.dumps({"host_ns": host_ns, "sensor_ns": utc_ns}) + "\n")
            record.flush()
        epoch = self._source.epoch(host_ns - self._epoch_ns)
        if epoch is None or host_ns < self._down_until_ns or self._plan.active("stall", t_s):
            return
        knows_time = host_ns >= self._lost_until_ns
        burst = sentences(epoch if knows_time else _lost(epoch), utc_ns, self._settings.sentences, knows_time)
        leaves_ns = host_ns + round((self._settings.latency_s + self._faults.delay_s(t_s)) * 1e9)
        data = b"".join(self._faults.apply(burst, t_s))
        for index in range(len(self.ports)):
            self._enqueue(index, data, leaves_ns)

    def _enqueue(self, index: int, data: bytes, leaves_ns: int) -> None:
        """In pieces, each due when its last byte is over the line; never before what went out earlier."""
        port = self.ports[index]
        due_ns = max(leaves_ns, self._free_ns[index])
        size = SLICE_BYTES if port.baud else max(len(data), 1)
        for at in range(0, len(data), size):
            piece = data[at : at + size]
            if port.baud:
                due_ns += len(piece) * BITS_A_BYTE * 1_000_000_000 // port.baud
            heapq.heappush(self._queue, (due_ns, self._queued, port, piece))
            self._queued += 1
        self._free_ns[index] = due_ns

    def _send_due(self, now_ns: int) -> None:
        while self._queue and self._queue[0][0] <= now_ns:
            _, _, port, piece = heapq.heappop(self._queue)
            port.send(piece)

    def _nap(self, stop: StopFlag, next_epoch_ns: int) -> None:
        due_ns = min(next_epoch_ns, self._queue[0][0] if self._queue else next_epoch_ns)
        left_s = (due_ns - time.monotonic_ns()) / 1e9
        if left_s > 0.0:
            stop.wait(min(left_s, TICK_S))


def _lost(epoch: GnssEpoch) -> GnssEpoch:
    """The same instant in a receiver that has no fix yet."""
    nan = float("nan")
    return GnssEpoch(nan, nan, nan, nan, 0, 0, nan, None, (nan, nan, nan), 0.0, 0.0)


def start(receiver: Receiver, stop: threading.Event, truth: Path | None = None) -> threading.Thread:
    """The receiver in a thread of this process."""
    thread = threading.Thread(target=receiver.run, args=(stop, truth), name="reach-emulator", daemon=True)
    thread.start()
    return thread
