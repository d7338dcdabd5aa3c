"""The receiving thread: takes datagrams off the sockets into preallocated blocks, stamps them, and does nothing else.

The kernel stamps each datagram on arrival (SO_TIMESTAMPNS), so the thread may sleep for 20 ms and take
bursts: it wakes 50 times a second instead of 2,283, and a busy interpreter does not blur the stamps. Each stamp is
moved to CLOCK_MONOTONIC and kept between the last moment the socket was empty and now, so that a step of the
host's clock cannot move it further than that.
"""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import time
from collections import deque
from dataclasses import dataclass, field
from threading import Event

import numpy as np
import numpy.typing as npt

from drivers.errors import SensorUnreachable

SLOT_BYTES = 1408
"""The longest data packet has 1380 bytes; longer datagrams are cut, and fail the length check."""
BLOCK_SLOTS = 128
BLOCKS = 48
"""2.7 s of packets at the full rate wait here for the decoder, before the kernel's buffer fills as well."""
PAUSE_S = 0.02
POLL_S = 0.1
BURST = 1024
"""Datagrams taken off one socket before the others have their turn."""
SO_TIMESTAMPNS = 35
SO_RXQ_OVFL = 40
_TIMESPEC = struct.Struct("@qq")
_COUNT = struct.Struct("@I")
_ANCILLARY_BYTES = socket.CMSG_SPACE(_TIMESPEC.size) + socket.CMSG_SPACE(_COUNT.size)


class Block:
    """Datagrams as they came: bytes one a row, lengths, times of reception. Filled by one thread, read by another."""

    def __init__(self) -> None:
        # Filled, so that the pages are there: those of np.zeros would come when the host is late already.
        self.slots: npt.NDArray[np.uint8] = np.full((BLOCK_SLOTS, SLOT_BYTES), 0xFF, np.uint8)
        self.rows = [memoryview(row) for row in self.slots]
        self.lengths: list[int] = []
        self.receive_ns: list[int] = []

    def __len__(self) -> int:
        return len(self.lengths)

    def clear(self) -> None:
        """Forget the content, keep the memory."""
        self.lengths.clear()
        self.receive_ns.clear()


@dataclass
class Source:
    """One bound socket, and what the kernel dropped on it because nobody took it in time."""

    socket: socket.socket
    buffer_bytes: int
    not_before_ns: int = field(default_factory=time.monotonic_ns)
    """What comes next did not arrive before this: the socket was empty, or an earlier datagram came."""
    kernel_drops: int = 0


class Receiver:
    """Receives from one LiDAR on any number of ports. `take()` hands over to the decoding thread."""

    def __init__(self) -> None:
        self._sources: list[Source] = []
        self._hosts: set[str] = set()
        self._free: deque[Block] = deque(Block() for _ in range(BLOCKS))
        self._filled: deque[Block] = deque()
        self._block = self._free.pop()
        self._arrived = Event()
        self._opened = Event()
        self._address = ""
        self.foreign = 0
        """Datagrams from somebody else."""

    def open(self, host: str, ports: tuple[int, ...], buffer_bytes: int) -> None:
        """Bind, once a host address: never to any address, which would shut out other programs on this host.

        SensorUnreachable when this host does not have the address (yet), or a port is taken.
        """
        if host in self._hosts:
            return
        opened: list[Source] = []
        try:
            for port in dict.fromkeys(ports):
                opened.append(_bind(host, port, buffer_bytes))
        except OSError as error:
            for source in opened:
                source.socket.close()
            raise SensorUnreachable(
                f"cannot receive on {host}, UDP ports {ports}: {error.strerror or error}; "
                "check host_address and whether another program uses these ports"
            ) from error
        self._sources = [*self._sources, *opened]
        self._hosts.add(host)
        self._opened.set()

    def accept_from(self, address: str) -> None:
        """Take datagrams of this LiDAR only."""
        self._address = address

    @property
    def buffer_bytes(self) -> int:
        """What the kernel granted, the least of all sockets; 0 before they are open."""
        return min((source.buffer_bytes for source in self._sources), default=0)

    @property
    def kernel_drops(self) -> int:
        """Datagrams the kernel dropped because the buffer was full."""
        return sum(source.kernel_drops for source in self._sources)

    def run(self, stop: Event) -> None:
        """Thread body. Sockets may be opened before or after it starts."""
        while not stop.is_set():
            self._turn(stop)

    def close(self) -> None:
        """Close the sockets, when no thread uses them any more."""
        for source in self._sources:
            source.socket.close()
        self._sources = []
        self._hosts.clear()

    def wait(self, timeout_s: float) -> bool:
        """Whether datagrams came within the time."""
        arrived = self._arrived.wait(timeout_s)
        self._arrived.clear()
        return arrived

    def take(self) -> Block | None:
        """The oldest filled block, None when there is none. Give it back when done."""
        with contextlib.suppress(IndexError):
            return self._filled.popleft()
        return None

    def give_back(self, block: Block) -> None:
        """The block may be filled again."""
        block.clear()
        self._free.append(block)

    def _turn(self, stop: Event) -> None:
        sources = self._sources
        if not sources:
            self._opened.wait(POLL_S)  # at once: the kernel stamps only from a moment after the first socket is open
            return
        if len(self._block) < BLOCK_SLOTS:
            poll = select.poll()
            for source in sources:
                poll.register(source.socket, select.POLLIN)
            poll.poll(POLL_S * 1000)
            for source in sources:
                self._drain(source)
        self._hand_over()
        stop.wait(PAUSE_S)

    def _drain(self, source: Source) -> None:
        """Take everything that waits on a socket; when no block is free, the kernel keeps the rest."""
        receive = source.socket.recvmsg_into
        offset_ns = _realtime_offset_ns()
        for _ in range(BURST):
            if len(self._block) == BLOCK_SLOTS and not self._hand_over():
                return
            try:
                length, ancillary, flags, sender = receive([self._block.rows[len(self._block)]], _ANCILLARY_BYTES)
            except BlockingIOError:
                source.not_before_ns = time.monotonic_ns()
                return
            except OSError:  # an ICMP error of an earlier datagram; the socket lives on
                continue
            receive_ns = _arrival_ns(source, ancillary, offset_ns)
            if sender[0] != self._address:
                self.foreign += 1
                continue
            self._block.lengths.append(length if not flags & socket.MSG_TRUNC else 0)
            self._block.receive_ns.append(receive_ns)

    def _hand_over(self) -> bool:
        """Pass the block on when it is full, or when the decoder has nothing to do. True when a fresh one is there."""
        full = len(self._block) == BLOCK_SLOTS
        if len(self._block) and (full or not self._filled) and self._free:
            self._filled.append(self._block)
            self._block = self._free.pop()
            self._arrived.set()
            return True
        return not full


def _realtime_offset_ns() -> int:
    """CLOCK_MONOTONIC minus CLOCK_REALTIME now, from the tightest of three readings."""
    readings = [(time.monotonic_ns(), time.time_ns(), time.monotonic_ns()) for _ in range(3)]
    before_ns, real_ns, after_ns = min(readings, key=lambda reading: reading[2] - reading[0])
    return (before_ns + after_ns) // 2 - real_ns


def _arrival_ns(source: Source, ancillary: list[tuple[int, int, bytes]], offset_ns: int) -> int:
    """Arrival on CLOCK_MONOTONIC, never earlier than the datagram before; notes the kernel's drops on the way."""
    now_ns = time.monotonic_ns()
    arrival_ns = now_ns
    for _, kind, data in ancillary:
        if kind == SO_TIMESTAMPNS and len(data) == _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack(data)
            arrival_ns = min(now_ns, seconds * 1_000_000_000 + nanoseconds + offset_ns)
        elif kind == SO_RXQ_OVFL:
            source.kernel_drops = _COUNT.unpack(data)[0]
    source.not_before_ns = max(source.not_before_ns, arrival_ns)
    return source.not_before_ns


def _bind(host: str, port: int, buffer_bytes: int) -> Source:
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer_bytes)
        for option in (SO_TIMESTAMPNS, SO_RXQ_OVFL):
            with contextlib.suppress(OSError):  # without: stamped on the way out of the socket, drops not counted
                bound.setsockopt(socket.SOL_SOCKET, option, 1)
        bound.bind((host, port))
        bound.setblocking(False)
    except OSError:
        bound.close()
        raise
    granted = bound.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2  # Linux reports twice what it grants
    return Source(bound, granted)
