"""The recorder as seen by its clients: requests with replies, and a stream of states."""

from __future__ import annotations

import socket
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

import msgspec

from edge.control.codec import LINE_LIMIT, LineSplitter, decode, encode
from edge.control.messages import PROTOCOL_VERSION, Reply, Request, Status
from edge.errors import ControlError

TIMEOUT_S = 10.0
"""Longer than a slow card takes to finish a session."""
_CHUNK = 65536


class ControlClient:
    """One connection, made at the first request. Not thread-safe; after a ControlError, make a new one.

    `with ControlClient(path) as recorder: recorder.request(Request("start", mission="plot 7"))`
    """

    def __init__(self, socket_path: Path, timeout_s: float = TIMEOUT_S) -> None:
        self._path = socket_path
        self._timeout_s = timeout_s
        self._socket: socket.socket | None = None
        self._splitter = LineSplitter(LINE_LIMIT)
        self._lines: deque[bytes] = deque()
        self._statuses: deque[Status] = deque(maxlen=1)
        self._last_id = 0

    def __enter__(self) -> ControlClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def connect(self) -> None:
        """Connect and agree on the version, if that has not happened. ControlError says what to do."""
        if self._socket is not None:
            return
        self._socket = self._open()
        try:
            self.request(Request("hello"))
        except ControlError:
            self.close()
            raise

    def request(self, request: Request) -> Reply:
        """Ask and wait for the answer. ControlError when the recorder refuses, or does not answer in time."""
        self.connect()
        self._last_id += 1
        numbered = msgspec.structs.replace(request, id=self._last_id)
        self._send(encode(numbered))
        reply = self._await_reply(numbered)
        if not reply.ok:
            raise ControlError(self._refusal(reply))
        return reply

    def status(self) -> Status:
        """The recorder's state now. ControlError as `request`."""
        self.request(Request("status"))
        return self._await_status()

    def subscribe(self) -> Iterator[Status]:
        """States as the recorder makes them, about four a second; only the newest when the caller is slow.

        Ends never by itself; ControlError when the recorder goes away or is silent for the timeout.
        """
        self.request(Request("subscribe"))
        while True:
            yield self._await_status()

    def close(self) -> None:
        """Hang up. Idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open(self) -> socket.socket:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        connection.settimeout(self._timeout_s)
        try:
            connection.connect(str(self._path))
        except OSError as error:
            connection.close()
            raise ControlError(_why_unreachable(self._path, error)) from error
        return connection

    def _await_reply(self, request: Request) -> Reply:
        deadline = time.monotonic() + self._timeout_s
        while True:
            line = decode(self._next_line(deadline, f"did not answer {request.command!r}"))
            if isinstance(line, Status):
                self._statuses.append(line)
            elif isinstance(line, Reply) and line.id in (request.id, 0):  # 0: to a line it could not read
                return line

    def _await_status(self) -> Status:
        deadline = time.monotonic() + self._timeout_s
        self._drain()
        while self._lines or not self._statuses:
            line = decode(self._next_line(deadline, "sent no state"))
            if isinstance(line, Status):
                self._statuses.append(line)
        return self._statuses.pop()

    def _next_line(self, deadline: float, complaint: str) -> bytes:
        while not self._lines:
            left = deadline - time.monotonic()
            if left <= 0:
                raise self._silent(complaint)
            self._receive(left, complaint)
        return self._lines.popleft()

    def _drain(self) -> None:
        """Take in what has already arrived, so that a slow caller gets the newest state."""
        while self._receive(0.0, ""):
            continue

    def _receive(self, wait_s: float, complaint: str) -> bool:
        """Whether anything came. wait_s 0: only what is there."""
        connection = self._connected()
        connection.settimeout(wait_s)
        try:
            data = connection.recv(_CHUNK)
        except BlockingIOError:
            return False
        except TimeoutError as error:
            raise self._silent(complaint) from error
        except OSError as error:
            raise ControlError(_gone(self._path)) from error
        if not data:
            raise ControlError(_gone(self._path))
        self._lines.extend(self._splitter.feed(data))
        return True

    def _send(self, line: bytes) -> None:
        connection = self._connected()
        connection.settimeout(self._timeout_s)
        try:
            connection.sendall(line)
        except TimeoutError as error:
            raise self._silent("took no request") from error
        except OSError as error:
            raise ControlError(_gone(self._path)) from error

    def _connected(self) -> socket.socket:
        if self._socket is None:
            raise ControlError("this client is closed; make a new one")
        return self._socket

    def _silent(self, complaint: str) -> ControlError:
        return ControlError(
            f"the recorder at {self._path} {complaint} within {self._timeout_s:g} s; "
            "see `journalctl -u mapforest-recorder`, and restart the service if it hangs"
        )

    def _refusal(self, reply: Reply) -> str:
        if reply.version != PROTOCOL_VERSION:
            return (
                f"the recorder ({reply.software or 'unknown version'}) speaks version {reply.version} of the control "
                f"protocol and this program version {PROTOCOL_VERSION}; restart the recorder with this installation"
            )
        return reply.error or "the recorder refused without a reason; see its log"


def _why_unreachable(path: Path, error: OSError) -> str:
    if isinstance(error, PermissionError):
        return (
            f"no permission to use {path}; join its group (`sudo usermod -aG mapforest $USER`, then log in again), "
            "or use sudo"
        )
    if isinstance(error, (FileNotFoundError, ConnectionRefusedError, NotADirectoryError)):
        return (
            f"the recorder is not running (nobody listens at {path}); start it with "
            "`sudo systemctl start mapforest-recorder`, or `mapforest recorder` in another terminal"
        )
    return f"cannot reach the recorder at {path}: {error.strerror or error}; check control.socket in the configuration"


def _gone(path: Path) -> str:
    return f"the recorder at {path} hung up: it was stopped or restarted; see `journalctl -u mapforest-recorder`"
