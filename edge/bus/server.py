"""The recorder's end: messages out to whoever subscribed, results in. It never waits for anybody.

Nothing is encoded that nobody subscribed to; what a subscriber is too slow for is dropped, and shows as a hole in the
sequence numbers.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import zmq

from edge.bus import results
from edge.bus.envelope import Envelope, subscription
from edge.config import Config
from edge.control.messages import Detecting, Location, Mapped
from edge.errors import FormatError
from edge.paths import BUS_NAME, RESULTS_NAME
from edge.recording.messages import Recordable
from edge.ros.encode import ENCODERS
from edge.ros.topics import Channel, channels

log = logging.getLogger(__name__)

WordT = TypeVar("WordT", Location, Detecting, Mapped)
QUEUE_LENGTH = 512
"""Two seconds of everything."""
HIGH_WATER = 400
_WAKE_MS = 20
"""The queue is emptied 50 times a second, so that `offer` need not wake anybody."""
_LONGEST_PATH = 100
"""Of a UNIX socket: 107 bytes."""
_STALE_S = 5.0


class BusServer:
    """`offer` is the tap; `sink` gets the poses and detections that come back. Between `start` and `stop`."""

    def __init__(self, config: Config, folder: Path, sink: Callable[[Recordable], None]) -> None:
        self.problem = ""
        """Why there is no bus, and what to do; empty when there is."""
        self.dropped = 0
        """Messages the bus itself had no room for."""
        self._channels: dict[type, Channel] = dict(channels(config.topics))
        self._folder = folder
        self._sink = sink
        self._queue: deque[tuple[int, Recordable]] = deque()
        self._sequence: Counter[type] = Counter()
        self._subscribed: set[bytes] = set()
        self._words: dict[type, tuple[float, Any]] = {}
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the sockets; what goes wrong is told in `problem`, never raised: recording comes first."""
        if len(str(self._folder / RESULTS_NAME)) > _LONGEST_PATH:
            self._fail(f"live pipeline: {self._folder} is too long a path for its sockets; set control.socket")
            return
        context: zmq.Context[zmq.Socket[bytes]] = zmq.Context(io_threads=1)
        try:
            out, back = context.socket(zmq.XPUB), context.socket(zmq.PULL)
            out.set_hwm(HIGH_WATER)
            back.set_hwm(HIGH_WATER)
            for socket, name in ((out, BUS_NAME), (back, RESULTS_NAME)):
                path = self._folder / name
                path.unlink(missing_ok=True)  # the control socket, held by then, says that no other recorder runs
                socket.bind(f"ipc://{path}")
                os.chmod(path, 0o660)
        except (zmq.ZMQError, OSError) as error:
            context.destroy(linger=0)
            self._fail(
                f"live pipeline: no sockets in {self._folder} ({error}); set control.socket to a place of its own"
            )
            return
        self._thread = threading.Thread(target=self._run, args=(context, out, back), name="bus", daemon=True)
        self._thread.start()

    def offer(self, message: Recordable) -> None:
        """Take a message. Any thread; returns at once."""
        kind = type(message)
        if self._thread is None or not self._wants(kind):
            return
        self._sequence[kind] += 1
        if len(self._queue) >= QUEUE_LENGTH:
            self.dropped += 1
            return
        self._queue.append((self._sequence[kind], message))

    @property
    def location(self) -> Location | None:
        """The pipeline's last word; None when it has been silent. Any thread."""
        return self._word(Location)

    @property
    def detecting(self) -> Detecting | None:
        """The detector's, likewise."""
        return self._word(Detecting)

    @property
    def mapped(self) -> Mapped | None:
        """The grounding's, likewise."""
        return self._word(Mapped)

    def stop(self) -> None:
        """Close the sockets. Idempotent."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(2.0)

    def _word(self, kind: type[WordT]) -> WordT | None:
        told_s, word = self._words.get(kind, (-_STALE_S, None))
        return word if time.monotonic() - told_s < _STALE_S else None

    def _wants(self, kind: type) -> bool:
        channel = self._channels.get(kind)
        return channel is not None and subscription(channel.topic) in self._subscribed

    def _fail(self, problem: str) -> None:
        self.problem = problem
        log.warning("%s", problem)

    def _run(self, context: zmq.Context[zmq.Socket[bytes]], out: zmq.Socket[bytes], back: zmq.Socket[bytes]) -> None:
        """Thread root."""
        try:
            poller = zmq.Poller()
            poller.register(out, zmq.POLLIN)
            poller.register(back, zmq.POLLIN)
            while not self._stop.is_set():
                ready = dict(poller.poll(_WAKE_MS))
                if out in ready:
                    self._note(out.recv())
                if back in ready:
                    self._take(back.recv_multipart())
                self._send(out)
        except Exception as error:  # the thread's root: the pipeline's trouble is not the recorder's
            log.exception("bus died")
            self._fail(f"live pipeline: its bus ended by an error ({error!r}); restart the recorder to have it back")
        finally:
            self._thread = None
            context.destroy(linger=0)

    def _note(self, word: bytes) -> None:
        """A subscription (1) or its end (0)."""
        if word[:1] == b"\x01":
            self._subscribed.add(word[1:])
        else:
            self._subscribed.discard(word[1:])

    def _send(self, out: zmq.Socket[bytes]) -> None:
        while self._queue:
            sequence, message = self._queue.popleft()
            kind = type(message)
            data = ENCODERS[kind](message, message.stamp_ns)
            envelope = Envelope(self._channels[kind].topic, sequence, message.receive_ns, message.stamp_ns, data)
            out.send_multipart(envelope.parts(), zmq.NOBLOCK)

    def _take(self, parts: list[bytes]) -> None:
        try:
            result = results.unpacked(parts)
        except FormatError as error:
            log.warning("bus: %s", error)
            return
        if isinstance(result, Location | Detecting | Mapped):
            self._words[type(result)] = time.monotonic(), result
        else:
            self._sink(result)
