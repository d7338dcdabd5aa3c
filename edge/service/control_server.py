"""The recorder's end of the control socket.

One thread runs the connections, a second one the commands, one after the other. No client can hold up another or the
recorder: lines are bounded, what a client does not read is bounded too, and a client past either is dropped.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import shutil
import socket
import stat
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Protocol

from edge.control.codec import REQUEST_LIMIT, decode_envelope, decode_request, encode
from edge.control.messages import PROTOCOL_VERSION, Line, Reply, Request, Status
from edge.errors import ControlError, EdgeError

log = logging.getLogger(__name__)

CLIENT_LIMIT = 32
BACKLOG_LIMIT = 256 * 1024
"""Bytes a client may leave unread: about 12 s of states, beyond what the kernel holds for it."""
_SHUTDOWN_S = 2.0
_HANG_UP_S = 0.5


class Commands(Protocol):
    """What carries out the requests."""

    def handle(self, request: Request, receive_ns: int) -> Reply:
        """start, stop, mark or validate, in the command thread. An EdgeError becomes a refusal."""

    def status(self) -> Status:
        """The newest state. Returns at once."""


class ControlServer:
    """Listens at `path` (mode 0660, group `group` if given) between `start` and `stop`."""

    def __init__(self, path: Path, commands: Commands, group: str = "", software: str = "") -> None:
        self._path = path
        self._commands = commands
        self._group = group
        self._software = software
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="command")
        self._clients: set[asyncio.StreamWriter] = set()
        self._subscribers: set[asyncio.StreamWriter] = set()
        self._stopping = asyncio.Event()
        self._inode = 0

    def start(self) -> None:
        """Take the socket and serve. ControlError when another recorder answers there, or the path cannot be used."""
        listening = _listen(self._path, self._group)
        self._inode = self._path.stat().st_ino
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, args=(self._loop, listening), name="control", daemon=True)
        self._thread.start()

    def publish(self, status: Status) -> None:
        """Send a state to every subscriber. Any thread; returns at once."""
        if self._loop is None or not self._subscribers:
            return
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody is left to hear it
            self._loop.call_soon_threadsafe(self._send_all, encode(status))

    def stop(self) -> None:
        """Hang up on everyone and remove the socket. Idempotent."""
        if self._loop is not None and self._thread is not None and self._thread.is_alive():
            with contextlib.suppress(RuntimeError):  # its loop has just ended
                self._loop.call_soon_threadsafe(self._stopping.set)
            self._thread.join(_SHUTDOWN_S)
        self._worker.shutdown(wait=False, cancel_futures=True)
        with contextlib.suppress(OSError):
            if self._inode and self._path.stat().st_ino == self._inode:
                self._path.unlink()

    def _run(self, loop: asyncio.AbstractEventLoop, listening: socket.socket) -> None:
        asyncio.set_event_loop(loop)
        try:
            loop.run_until_complete(self._serve_until_stopped(listening))
        finally:
            loop.close()

    async def _serve_until_stopped(self, listening: socket.socket) -> None:
        server = await asyncio.start_unix_server(self._serve, sock=listening, limit=REQUEST_LIMIT)
        await self._stopping.wait()
        asyncio.get_running_loop().remove_reader(listening.fileno())
        await self._hang_up()
        server.close()

    async def _hang_up(self) -> None:
        """End every connection. Those just being made first finish that: cut short, asyncio would leak them."""
        for _ in range(3):
            await asyncio.sleep(0)
        for writer in tuple(self._clients):
            writer.transport.abort()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        if others:
            _, stuck = await asyncio.wait(others, timeout=_HANG_UP_S)
            for task in stuck:
                task.cancel()
            await asyncio.gather(*stuck, return_exceptions=True)
        await asyncio.sleep(0)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._clients) >= CLIENT_LIMIT:
            self._send(writer, self._refusal(0, f"more than {CLIENT_LIMIT} clients; close one"))
            writer.close()
            return
        self._clients.add(writer)
        try:
            while line := await reader.readline():
                if not await self._answer(line, writer):
                    break
        except (ValueError, ConnectionError) as error:  # ValueError: readline past the limit
            log.info("control: dropped a client: %s", error)
            self._send(writer, self._refusal(0, f"a request has at most {REQUEST_LIMIT} bytes"))
        finally:
            self._clients.discard(writer)
            self._subscribers.discard(writer)
            writer.close()

    async def _answer(self, line: bytes, writer: asyncio.StreamWriter) -> bool:
        """Whether the connection goes on."""
        receive_ns = time.monotonic_ns()
        envelope = decode_envelope(line)
        if envelope.version != PROTOCOL_VERSION:
            self._send(writer, self._refusal(envelope.id, f"control protocol {envelope.version} is not spoken here"))
            return True
        try:
            request = decode_request(line)
        except ControlError as error:
            self._send(writer, self._refusal(0, str(error)))
            return False
        self._send(writer, await self._reply(request, receive_ns))
        if request.command == "status":
            self._send(writer, self._commands.status())
        elif request.command == "subscribe":
            self._subscribers.add(writer)
            self._send(writer, self._commands.status())
        return True

    async def _reply(self, request: Request, receive_ns: int) -> Reply:
        if request.command in ("hello", "status", "subscribe"):
            return Reply(request.id, ok=True, software=self._software)
        return await asyncio.get_running_loop().run_in_executor(self._worker, self._carry_out, request, receive_ns)

    def _carry_out(self, request: Request, receive_ns: int) -> Reply:
        try:
            return self._commands.handle(request, receive_ns)
        except EdgeError as error:
            return self._refusal(request.id, str(error))
        except Exception as error:  # the command thread's root: the recorder must outlive a bug in a command
            log.exception("control: %r failed", request.command)
            return self._refusal(request.id, f"{request.command} failed inside the recorder ({error}); see its log")

    def _refusal(self, request_id: int, error: str) -> Reply:
        return Reply(request_id, ok=False, error=error, software=self._software)

    def _send_all(self, line: bytes) -> None:
        for writer in tuple(self._subscribers):
            self._write(writer, line)

    def _send(self, writer: asyncio.StreamWriter, line: Line) -> None:
        self._write(writer, encode(line))

    def _write(self, writer: asyncio.StreamWriter, line: bytes) -> None:
        if writer.is_closing():
            return
        writer.write(line)
        if writer.transport.get_write_buffer_size() > BACKLOG_LIMIT:
            log.warning("control: dropped a client that does not read")
            self._subscribers.discard(writer)
            writer.transport.abort()


def _listen(path: Path, group: str) -> socket.socket:
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        _make_folder(path.parent)
        _remove_stale(path)
        listening.bind(str(path))
        # Before listen(): until then connecting is refused, so nobody slips in under the umask's mode.
        os.chmod(path, 0o660)
        if group:
            shutil.chown(path, group=group)
        listening.listen()
    except LookupError as error:
        listening.close()
        path.unlink(missing_ok=True)
        raise ControlError(f"control.group: no group {group!r} on this machine; create it or change the key") from error
    except (OSError, ControlError) as error:
        listening.close()
        if isinstance(error, ControlError):
            raise
        raise ControlError(f"cannot listen at {path}: {error.strerror or error}; set control.socket") from error
    listening.setblocking(False)
    return listening


def _make_folder(folder: Path) -> None:
    if not folder.exists():
        folder.mkdir(mode=0o700, parents=True)
    elif folder.name == f"mapforest-{os.getuid()}" and folder.stat().st_uid != os.getuid():
        raise ControlError(f"{folder} belongs to somebody else; set control.socket to a path of your own")


def _remove_stale(path: Path) -> None:
    """Clear the way if what stands there is a socket nobody answers at."""
    if not path.exists():
        return
    if not stat.S_ISSOCK(path.stat().st_mode):
        raise ControlError(f"{path} is in the way and is no socket; move it, or set control.socket")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(1.0)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return
        except TimeoutError:
            pass  # its backlog is full: somebody is there
    raise ControlError(f"another recorder is running (it answers at {path}); stop it first, or use it")
