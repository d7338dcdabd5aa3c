"""Finding a LiDAR: by asking everybody, and by listening to the status it pushes."""

from __future__ import annotations

import contextlib
import select
import socket
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from threading import Event

import psutil

from drivers.errors import ProtocolError, SensorUnreachable
from drivers.livox.commands import MID360, decode_discovered, decode_values
from drivers.livox.config import Config
from drivers.livox.frames import LONGEST_BYTES, Command, Frame, Kind, Sender, decode, encode
from drivers.livox.keys import Key

ASK_EVERY_S = 1.0
ANSWER_S = 0.5


@dataclass(frozen=True, slots=True)
class Found:
    """A LiDAR and how it was found. A push does not tell the device type; it is read later."""

    address: str
    command_port: int
    serial: str
    device_type: int


def discover(config: Config, status: StatusListener, stop: Event) -> Found | None:
    """Ask everybody once, and listen. None when nobody suitable was heard until the next question is due."""
    return _search(config, config.discovery_address, status, ASK_EVERY_S, stop)


def ask(config: Config, stop: Event) -> Found | None:
    """Ask the configured LiDAR what it is. None when its answer, which is a broadcast, does not get through."""
    return _search(config, config.address, None, ANSWER_S, stop)


def _search(config: Config, target: str, status: StatusListener | None, wait_s: float, stop: Event) -> Found | None:
    with contextlib.ExitStack() as stack:
        pairs = [_ask(host, target, config, stack) for host in _hosts(config, target)]
        inboxes = [inbox for pair in pairs for inbox in pair]
        pushed = status.sockets if status else []
        deadline = time.monotonic() + wait_s
        while (left := deadline - time.monotonic()) > 0 and not stop.is_set():
            ready, _, _ = select.select([*inboxes, *pushed], [], [], min(left, 0.2))
            heard: Iterable[Found] = status.heard(config) if status else ()
            for found in (*_answers(ready, inboxes), *heard):
                if _wanted(found, config):
                    return found
    return None


def _wanted(found: Found, config: Config) -> bool:
    return config.serial_number in ("", found.serial) and config.address in ("", found.address)


def _hosts(config: Config, target: str) -> list[str]:
    """Addresses to ask from: a broadcast leaves by the network of the address it is sent from."""
    if config.host_address:
        return [config.host_address]
    interfaces = psutil.net_if_addrs().values()
    addresses = [item.address for items in interfaces for item in items if item.family == socket.AF_INET]
    return [address for address in addresses if address.startswith("127.") == target.startswith("127.")]


def _ask(host: str, target: str, config: Config, stack: contextlib.ExitStack) -> tuple[socket.socket, ...]:
    """Send a question from `host`; returns the sockets the answer may come to.

    The answer is broadcast to the port the question came from, even when one LiDAR alone was asked. A socket bound
    to `host` never sees that, so a second one is bound to the same port of any address.
    """
    try:
        asking = stack.enter_context(_broadcaster(host, config.host_discovery_port))
        hearing = stack.enter_context(_broadcaster("", asking.getsockname()[1]))
        question = encode(Frame(Command.DISCOVER, 1, Kind.REQUEST, Sender.HOST))
        asking.sendto(question, (target, config.discovery_port))
    except OSError:  # this network is down; others are asked as well, and again
        return ()
    return asking, hearing


def _answers(ready: list[socket.socket], inboxes: list[socket.socket]) -> Iterator[Found]:
    for inbox in ready:
        if inbox not in inboxes:
            continue
        with contextlib.suppress(ProtocolError, OSError):
            frame = decode(inbox.recv(LONGEST_BYTES))
            if frame.command == Command.DISCOVER and frame.kind is Kind.ACK:
                answer = decode_discovered(frame.data)
                yield Found(answer.address, answer.command_port, answer.serial, answer.device_type)


def _broadcaster(host: str, port: int) -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        made.bind((host, port))
        made.setblocking(False)
    except OSError:
        made.close()
        raise
    return made


class StatusListener:
    """Hears the status pushes: those sent to this host, and those a LiDAR of factory settings broadcasts."""

    def __init__(self, config: Config) -> None:
        """Binds. SensorUnreachable when this host cannot."""
        hosts = [config.host_address, config.discovery_address] if config.host_address else [""]
        self.sockets: list[socket.socket] = []
        try:
            for host in hosts:
                self.sockets.append(_broadcaster(host, config.host_status_port))
        except OSError as error:
            self.close()
            raise SensorUnreachable(
                f"cannot listen for the LiDAR's status on {host or 'any address'}:{config.host_status_port}: "
                f"{error.strerror}; check host_address and whether another program uses this port"
            ) from error

    def close(self) -> None:
        """Stop listening."""
        for opened in self.sockets:
            opened.close()

    def pushes(self) -> Iterator[tuple[str, dict[int, object]]]:
        """Sender and parameters of each push that waits; damaged ones are passed over."""
        for opened in self.sockets:
            while (datagram := _waiting(opened)) is not None:
                with contextlib.suppress(ProtocolError):
                    frame = decode(datagram[0])
                    if frame.command == Command.PUSH and frame.sender is Sender.LIDAR:
                        yield datagram[1], decode_values(frame.data)

    def heard(self, config: Config) -> Iterator[Found]:
        """Whom the pushes that wait are from."""
        for sender, values in self.pushes():
            yield Found(sender, config.command_port, str(values.get(Key.SERIAL, "")), MID360)


def _waiting(opened: socket.socket) -> tuple[bytes, str] | None:
    try:
        datagram, sender = opened.recvfrom(LONGEST_BYTES)
    except OSError:
        return None
    return datagram, sender[0]
