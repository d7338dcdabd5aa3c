"""The pipeline's end: messages in, results out. One thread."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType

import zmq

from edge.bus import results
from edge.bus.envelope import Envelope, subscription, unpacked
from edge.bus.results import Result
from edge.bus.server import HIGH_WATER
from edge.errors import FormatError
from edge.paths import BUS_NAME, RESULTS_NAME

_BATCH = 64


class BusClient:
    """Connects by itself, and again when the recorder comes back. A context manager."""

    def __init__(self, folder: Path, topics: Sequence[str]) -> None:
        self.lost: Counter[str] = Counter()
        """Messages by topic that did not get here."""
        self.unsent = 0
        """Results the recorder did not take."""
        self._last: dict[str, int] = {}
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context(io_threads=1)
        self._in, self._out = self._context.socket(zmq.SUB), self._context.socket(zmq.PUSH)
        for socket, name in ((self._in, BUS_NAME), (self._out, RESULTS_NAME)):
            socket.set_hwm(HIGH_WATER)
            socket.reconnect_ivl_max = 2000
            socket.connect(f"ipc://{folder / name}")
        for topic in topics:
            self._in.subscribe(subscription(topic))

    def __enter__(self) -> BusClient:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Idempotent."""
        self._context.destroy(linger=0)

    def receive(self, timeout_s: float) -> Iterator[Envelope]:
        """What is there, a quarter of a second of it at most; waits up to `timeout_s` for the first."""
        if not self._in.poll(int(timeout_s * 1000)):
            return
        for _ in range(_BATCH):
            try:
                envelope = unpacked(self._in.recv_multipart(zmq.NOBLOCK))
            except zmq.Again:
                return
            except FormatError:
                continue
            self._count(envelope)
            yield envelope

    def send(self, result: Result) -> None:
        """Hand a result to the recorder; without one it is dropped and counted."""
        try:
            self._out.send_multipart(results.packed(result), zmq.NOBLOCK)
        except zmq.Again:
            self.unsent += 1

    def _count(self, envelope: Envelope) -> None:
        last = self._last.get(envelope.topic)
        if last is not None and envelope.sequence > last:  # less: the recorder was started again
            self.lost[envelope.topic] += envelope.sequence - last - 1
        self._last[envelope.topic] = envelope.sequence
