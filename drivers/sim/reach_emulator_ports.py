"""The emulated receiver's two outputs: a pseudo-terminal behind a symbolic link, and a TCP server."""

from __future__ import annotations

import contextlib
import ipaddress
import os
import socket
import tty
from pathlib import Path
from typing import Protocol

from drivers.errors import SimulationError

BITS_A_BYTE = 10
"""8N1 on the wire."""


class Port(Protocol):
    """One output. Nothing blocks: what nobody takes is lost, as on a wire."""

    baud: int
    """Bits a second; 0: as fast as it goes."""

    def open(self) -> None:
        """Appear. Idempotent."""

    def send(self, data: bytes) -> None:
        """To whoever listens."""

    def close(self) -> None:
        """Vanish: whoever listens sees the link go. Idempotent."""


class PseudoTerminal:
    """A serial device named by a symbolic link, as udev makes for the real one."""

    def __init__(self, link: Path, baud: int) -> None:
        self.baud = baud
        self._link = link
        self._ends: tuple[int, int] | None = None

    def open(self) -> None:
        if self._ends is not None:
            return
        master, slave = os.openpty()
        # The slave stays open here too: without a reader the master would fail with EIO.
        self._ends = master, slave
        tty.setraw(slave)
        os.set_blocking(master, False)
        self._link.parent.mkdir(parents=True, exist_ok=True)
        beside = self._link.with_name(f".{self._link.name}.{os.getpid()}")
        beside.unlink(missing_ok=True)
        beside.symlink_to(os.ttyname(slave))
        beside.replace(self._link)

    def send(self, data: bytes) -> None:
        if self._ends is not None:
            with contextlib.suppress(BlockingIOError):  # 4 kB are waiting already: nobody reads
                os.write(self._ends[0], data)

    def close(self) -> None:
        if self._ends is None:
            return
        self._link.unlink(missing_ok=True)
        for end in self._ends:
            os.close(end)
        self._ends = None


class TcpServer:
    """Any number of clients, each sent everything. Loopback only."""

    def __init__(self, host: str, port: int) -> None:
        if not ipaddress.ip_address(host).is_loopback:
            raise SimulationError(f"reach emulator: {host} is no loopback address, use one of 127.0.0.0/8")
        self.baud = 0
        self.address = (host, port)
        """With port 0: the port the system picked, once open."""
        self._listener: socket.socket | None = None
        self._clients: list[socket.socket] = []

    def open(self) -> None:
        if self._listener is not None:
            return
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind(self.address)
            listener.listen(8)
        except OSError as error:
            listener.close()
            raise SimulationError(f"reach emulator: cannot listen on {self.address}: {error.strerror}") from error
        listener.setblocking(False)
        self.address = listener.getsockname()
        self._listener = listener

    def send(self, data: bytes) -> None:
        self._accept()
        for client in list(self._clients):
            try:
                complete = client.send(data) == len(data)
            except OSError:
                complete = False
            if not complete:  # gone, or so far behind that its buffer is full
                client.close()
                self._clients.remove(client)

    def close(self) -> None:
        for open_socket in (*self._clients, self._listener):
            if open_socket is not None:
                open_socket.close()
        self._clients.clear()
        self._listener = None

    def _accept(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while self._listener is not None:
                client, _ = self._listener.accept()
                client.setblocking(False)
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._clients.append(client)
