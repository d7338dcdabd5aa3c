"""The emulated network of the LiDAR: carries datagrams, and does to them what a fault plan says."""

from __future__ import annotations

import contextlib
import heapq
import random
import socket
from dataclasses import dataclass, field
from typing import TypeAlias

from drivers.livox.crc import Buffer
from drivers.sim.faults import FaultPlan

Destination: TypeAlias = tuple[str, int]
LONGEST_GARBAGE = 1500
AT_ONCE_NS = 500_000
"""The emulator cannot wait for less than a millisecond; shorter delays are none, lest all packets come that late."""


@dataclass
class Tally:
    """What was done to the packets of one stream; for tests and evaluation."""

    sent: int = 0
    lost: int = 0
    duplicated: int = 0
    reordered: int = 0
    corrupted: int = 0


@dataclass(frozen=True, slots=True)
class Levels:
    """The faults that hold now."""

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    corrupt: float = 0.0
    delay_s: float = 0.0
    garbage_hz: float = 0.0
    cut: bool = False

    @property
    def clean(self) -> bool:
        """Whether datagrams just pass."""
        return not (self.loss or self.duplicate or self.reorder or self.corrupt or self.delay_s or self.cut)


def levels(plan: FaultPlan, t_s: float) -> Levels:
    """Faults at a time of the plan."""
    return Levels(
        loss=plan.level("loss", t_s),
        duplicate=plan.level("duplicate", t_s),
        reorder=plan.level("reorder", t_s),
        corrupt=plan.level("corrupt", t_s),
        delay_s=plan.level("delay_jitter", t_s),
        garbage_hz=plan.level("garbage", t_s),
        cut=plan.active("disconnect", t_s),
    )


@dataclass
class Stream:
    """A socket that packets of one kind leave from."""

    socket: socket.socket
    tally: Tally = field(default_factory=Tally)
    held: tuple[Buffer, Destination] | None = None


class Channel:
    """Sends packets through the faults. Only ever to loopback: any other destination is a void."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._late: list[tuple[int, int, socket.socket, Buffer, Destination]] = []
        self._order = 0
        self._garbage_due = 0.0
        self.levels = Levels()

    def send(self, stream: Stream, packet: Buffer, to: Destination, now_ns: int) -> None:
        """One packet, through what holds now."""
        faults, tally, chance = self.levels, stream.tally, self._random.random
        tally.sent += 1
        if faults.clean and stream.held is None:
            deliver(stream.socket, packet, to)
            return
        if faults.cut or (faults.loss and chance() < faults.loss):
            tally.lost += 1
            return
        if faults.corrupt and chance() < faults.corrupt:
            tally.corrupted += 1
            packet = self._flipped(packet)
        if faults.reorder and stream.held is None and chance() < faults.reorder:
            tally.reordered += 1
            stream.held = (packet, to)
            return
        copies = 1
        if faults.duplicate and chance() < faults.duplicate:
            tally.duplicated += 1
            copies = 2
        for _ in range(copies):
            self._pass(stream.socket, packet, to, now_ns)
        if stream.held is not None:
            held, stream.held = stream.held, None
            self._pass(stream.socket, *held, now_ns)

    def release(self, now_ns: int) -> int | None:
        """Deliver the delayed packets whose time has come. Returns when the next one is due."""
        while self._late and self._late[0][0] <= now_ns:
            _, _, via, packet, to = heapq.heappop(self._late)
            if not self.levels.cut:
                deliver(via, packet, to)
        return self._late[0][0] if self._late else None

    def litter(self, sockets: list[socket.socket], to: list[Destination], elapsed_s: float) -> None:
        """Random datagrams, at the rate that holds now, from the LiDAR's sockets to the host's."""
        self._garbage_due = min(self._garbage_due + self.levels.garbage_hz * elapsed_s, 100.0)
        while self._garbage_due >= 1.0:
            self._garbage_due -= 1.0
            garbage = self._random.randbytes(self._random.randrange(LONGEST_GARBAGE))
            deliver(self._random.choice(sockets), garbage, self._random.choice(to))

    def _pass(self, via: socket.socket, packet: Buffer, to: Destination, now_ns: int) -> None:
        mean_s = self.levels.delay_s
        delay_ns = round(self._random.expovariate(1.0 / mean_s) * 1e9) if mean_s else 0
        if delay_ns < AT_ONCE_NS:
            deliver(via, packet, to)
            return
        self._order += 1
        heapq.heappush(self._late, (now_ns + delay_ns, self._order, via, packet, to))

    def _flipped(self, packet: Buffer) -> bytes:
        damaged = bytearray(packet)
        for _ in range(self._random.randint(1, 8)):
            damaged[self._random.randrange(len(damaged))] ^= 1 << self._random.randrange(8)
        return bytes(damaged)


def deliver(via: socket.socket, packet: Buffer, to: Destination) -> None:
    """Send to loopback. A host that is not there, or whose buffer is full, is not the LiDAR's concern."""
    if to[0].startswith("127.") and to[1] > 0:
        with contextlib.suppress(OSError):
            via.sendto(packet, to)
