"""The line to the recorder: reconnects for ever, posts what arrives, sends what is asked."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from textual.message import Message

from edge.control.codec import LINE_LIMIT, decode, encode
from edge.control.messages import PROTOCOL_VERSION, Reply, Request, Status
from edge.errors import ControlError
from ui.messages import Connected, ConnectionLost, Replied, StatusArrived

FIRST_WAIT_S = 0.25
LONGEST_WAIT_S = 2.0
"""The recorder restarts within seconds; an operator should not wait longer than that for the screen."""

Post = Callable[[Message], object]


class Connection(Protocol):
    """What the app needs of the recorder."""

    async def run(self, post: Post) -> None:
        """Stay connected until cancelled, posting what arrives. Never raises for what the recorder does."""

    def send(self, request: Request) -> bool:
        """Send now, without waiting. False when there is nobody to send it to."""


class SocketConnection:
    """A connection over the recorder's UNIX socket. Lives in the app's event loop."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._writer: asyncio.StreamWriter | None = None

    async def run(self, post: Post) -> None:
        wait_s = FIRST_WAIT_S
        while True:
            try:
                reader, self._writer = await asyncio.open_unix_connection(self._path, limit=LINE_LIMIT)
                wait_s = FIRST_WAIT_S
                await self._talk(reader, post)
                post(ConnectionLost("The recorder closed the connection."))
            except (OSError, ControlError, ValueError) as error:  # ValueError: asyncio's line too long
                post(ConnectionLost(self._explain(error)))
            finally:
                await self._close()
            await asyncio.sleep(wait_s)
            wait_s = min(2 * wait_s, LONGEST_WAIT_S)

    def send(self, request: Request) -> bool:
        if self._writer is None or self._writer.is_closing():
            return False
        self._writer.write(encode(request))
        return True

    async def _talk(self, reader: asyncio.StreamReader, post: Post) -> None:
        self.send(Request("hello"))
        self.send(Request("subscribe"))
        post(Connected())
        while line := await reader.readline():
            match decode(line):
                case Status() as status:
                    self._check(status.version)
                    post(StatusArrived(status))
                case Reply() as reply:
                    self._check(reply.version)
                    post(Replied(reply))

    def _check(self, version: int) -> None:
        if version != PROTOCOL_VERSION:
            raise ControlError(f"The recorder speaks protocol {version}, this screen {PROTOCOL_VERSION}: update both.")

    def _explain(self, error: Exception) -> str:
        match error:
            case FileNotFoundError():
                return f"No socket at {self._path}: the recorder is not running, or --socket is wrong."
            case PermissionError():
                return f"Not allowed to open {self._path}: join the group that owns it and log in again."
            case ConnectionRefusedError():
                return f"Nobody answers at {self._path}: the recorder has stopped."
            case _:
                return str(error)

    async def _close(self) -> None:
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()
            with contextlib.suppress(OSError):  # it may have broken before it could be closed
                await writer.wait_closed()
