"""The two ways to a Reach: a serial device, and TCP. Both hand over bytes as they come."""

from __future__ import annotations

import contextlib
import errno
import glob
import os
import select
import socket
import termios
import time
from threading import Event
from typing import Protocol

import serial
from serial.tools import list_ports

from drivers.errors import SensorUnreachable
from drivers.reach.config import SerialEndpoint, TcpEndpoint

USB_VENDOR, USB_PRODUCT = 0x3032, 0x0013
STABLE_PATHS = ("/dev/mapforest/gnss", "/dev/serial/by-id/*[Ee]mlid*", "/dev/serial/by-id/*[Rr]each*")
CONNECT_TIMEOUT_S = 5.0
STOP_LOOK_S = 0.1
READ_BYTES = 4096


class Link(Protocol):
    """An open link. `address` is where it leads, for people."""

    address: str

    def read(self, timeout_s: float) -> bytes:
        """What arrived, empty when nothing did in time. SensorUnreachable when the link is gone."""

    def close(self) -> None:
        """Idempotent."""


def open_link(endpoint: SerialEndpoint | TcpEndpoint, baud: int, stop: Event) -> Link:
    """An open link without old bytes in it. SensorUnreachable says why there is none, and what to do.

    A connection that nobody answers is given up after `CONNECT_TIMEOUT_S`, or as soon as `stop` is set.
    """
    if isinstance(endpoint, TcpEndpoint):
        return TcpLink(endpoint, stop)
    return SerialLink(endpoint.path or find_device(), baud)


def find_device() -> str:
    """Path of the Reach on USB, a name that survives replugging first."""
    for pattern in STABLE_PATHS:
        for path in sorted(glob.glob(pattern)):
            return path
    for port in list_ports.comports():
        if (port.vid, port.pid) == (USB_VENDOR, USB_PRODUCT):
            return str(port.device)
    raise SensorUnreachable(
        "no Reach on any USB port: plug it in with a data cable, or set endpoint to its serial device or TCP address"
    )


class SerialLink:
    """A serial device, held exclusively. Input of before the opening is thrown away."""

    def __init__(self, path: str, baud: int) -> None:
        self.address = path
        try:
            self._serial = serial.Serial(path, baud, timeout=0, exclusive=True)
        except (OSError, ValueError) as error:
            raise SensorUnreachable(_why_not_opened(path, error)) from error
        try:
            self._serial.reset_input_buffer()
        except termios.error as error:  # taken away within the last millisecond
            self._serial.close()
            raise SensorUnreachable(_why_not_opened(path, error)) from error
        self._poll = _poll_for(self._serial.fileno())

    def read(self, timeout_s: float) -> bytes:
        if not self._poll.poll(timeout_s * 1000.0):
            return b""
        try:
            data = os.read(self._serial.fileno(), READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise SensorUnreachable(f"{self.address} is gone ({error.strerror}): check cable and power") from error
        if not data:
            raise SensorUnreachable(f"{self.address} is gone: check cable and power")
        return data

    def close(self) -> None:
        with contextlib.suppress(OSError):  # the device may be gone, and there is nothing left to save
            self._serial.close()


class TcpLink:
    """A TCP connection to the receiver's position output."""

    def __init__(self, endpoint: TcpEndpoint, stop: Event) -> None:
        self.address = f"{endpoint.host}:{endpoint.port}"
        try:
            self._socket = _connect(endpoint, stop)
        except (OSError, UnicodeError) as error:  # UnicodeError: a host name that can be none
            reason = getattr(error, "strerror", None) or error
            raise SensorUnreachable(
                f"{self.address} does not answer ({reason}): check the network, and that the position"
                " output is a TCP server on that port"
            ) from error
        self._poll = _poll_for(self._socket.fileno())

    def read(self, timeout_s: float) -> bytes:
        if not self._poll.poll(timeout_s * 1000.0):
            return b""
        try:
            data = self._socket.recv(READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise SensorUnreachable(f"{self.address} broke off ({error.strerror})") from error
        if not data:
            raise SensorUnreachable(f"{self.address} closed the connection")
        return data

    def close(self) -> None:
        self._socket.close()


def _connect(endpoint: TcpEndpoint, stop: Event) -> socket.socket:
    """A connected, non-blocking socket; OSError. Host names are looked up at the first address they have."""
    family, kind, protocol, _, address = socket.getaddrinfo(endpoint.host, endpoint.port, type=socket.SOCK_STREAM)[0]
    link = socket.socket(family, kind, protocol)
    link.setblocking(False)
    code = _dial(link, address, stop)
    if code:
        link.close()
        raise OSError(code, os.strerror(code))
    return link


def _dial(link: socket.socket, address: object, stop: Event) -> int:
    """0 once connected, otherwise the error number."""
    code = link.connect_ex(address)  # type: ignore[arg-type]  # as getaddrinfo gave it
    poll = select.poll()
    poll.register(link, select.POLLOUT)
    deadline = time.monotonic() + CONNECT_TIMEOUT_S
    while code == errno.EINPROGRESS:
        if poll.poll(STOP_LOOK_S * 1000.0):
            code = link.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        elif stop.is_set() or time.monotonic() > deadline:
            code = errno.ETIMEDOUT
    return code


def _poll_for(descriptor: int) -> select.poll:
    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    return poll


def _why_not_opened(path: str, error: Exception) -> str:
    if not os.path.exists(path):
        return f"{path} does not exist: plug the Reach in, or correct the endpoint"
    if not os.access(path, os.R_OK | os.W_OK):
        return f"{path} may not be opened: add the user to the group dialout, or install the udev rules"
    if "exclusively lock" in str(error):
        return f"{path} is in use by another program: stop it (gpsd, ModemManager, another recorder)"
    return f"{path} cannot be opened: {error}"
