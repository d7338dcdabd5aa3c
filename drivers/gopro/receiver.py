"""The UDP side: one socket that takes the stream in and sends the keep-alive out, in a thread of its own."""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections.abc import Callable

from drivers.errors import SensorRefused
from drivers.gopro.datagrams import Arrival, DatagramOrder
from drivers.gopro.frames import FrameBuilder
from drivers.gopro.keepalive import KEEP_ALIVE, KeepAlive
from drivers.gopro.transport_stream import AccessUnit, Demuxer
from drivers.messages import VideoFrame

logger = logging.getLogger(__name__)
DATAGRAM_LIMIT = 65536
BUFFER_BYTES = 4 << 20
"""Two seconds of a 1080p webcam stream."""
HOLD_S = 0.1
"""Silence after which a datagram held back for its neighbour is let go, and the stop event is looked at."""
FLUSH_S = 1.0
"""Silence after which the last access unit is taken for complete."""


class Receiver:
    """Receives from one camera. `open` first, then `start`; `close` ends and joins the thread."""

    def __init__(
        self, frames: FrameBuilder, emit: Callable[[VideoFrame], None], new_epoch: Callable[[int], None]
    ) -> None:
        """new_epoch: told the arrival time of the frame with which the stream clock began anew."""
        self._frames = frames
        self._emit = emit
        self._new_epoch = new_epoch
        self._socket: socket.socket | None = None
        self._camera: tuple[str, int] | None = None
        self._keep_alive = KeepAlive()
        self._ending = threading.Event()
        self._restart = threading.Event()
        self._thread: threading.Thread | None = None
        self._flushed = True
        self.order = DatagramOrder()
        self.demuxer = Demuxer()
        self.foreign = 0
        """Datagrams from somebody else."""
        self.failure = ""
        """What ended the thread, empty while all is well."""
        self.last_datagram_s = 0.0
        """Monotonic time of the newest datagram of the camera."""

    def open(self, host: str, port: int) -> None:
        """Bind, unless it is done already. SensorRefused says what is in the way."""
        if self._socket is not None:
            return
        opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
            opened.bind((host, port))
        except OSError as error:
            opened.close()
            raise SensorRefused(f"UDP port {port} of {host or 'this computer'} cannot be opened: {error}") from error
        opened.settimeout(HOLD_S)
        self._socket = opened

    def start(self) -> None:
        """Receive from now on. Does nothing when it does already."""
        if self._thread is not None and self._thread.is_alive():
            return
        self.failure = ""
        self._ending.clear()
        self._thread = threading.Thread(target=self._root, name="gopro-stream", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End and join. A half-received access unit goes."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def watch(self, camera: tuple[str, int] | None) -> None:
        """Take the stream of this camera, and keep it alive from now on; None: leave it alone."""
        if camera != self._camera:
            self._camera = camera
        self._keep_alive.now()

    def restarted(self) -> None:
        """The stream was asked to start anew."""
        self._restart.set()
        self._keep_alive.now()

    def _root(self) -> None:
        try:
            self._run()
        except Exception as error:
            logger.exception("the camera's stream thread ended")
            self.failure = f"{type(error).__name__}: {error}"

    def _run(self) -> None:
        assert self._socket is not None
        while not self._ending.is_set():
            self._stay_alive()
            try:
                datagram, sender = self._socket.recvfrom(DATAGRAM_LIMIT)
            except TimeoutError:
                self._idle()
                continue
            except OSError as error:  # the interface went away; it may come back
                logger.warning("camera stream: %s", error)
                self._ending.wait(HOLD_S)
                continue
            self._datagram(datagram, sender[0], time.monotonic_ns())

    def _stay_alive(self) -> None:
        camera = self._camera
        if camera is None or not self._keep_alive.due(time.monotonic()):
            return
        assert self._socket is not None
        try:
            self._socket.sendto(KEEP_ALIVE, camera)
        except OSError as error:  # no route while the link is down: the HTTP side reports it
            logger.debug("keep-alive not sent: %s", error)

    def _datagram(self, datagram: bytes, sender: str, receive_ns: int) -> None:
        camera = self._camera
        if camera is None or sender != camera[0]:
            self.foreign += 1
            return
        if self._restart.is_set():
            self._restart.clear()
            self.order.restart()
            self.demuxer.restart()
            self._frames.restarted()
        self.last_datagram_s = receive_ns / 1e9
        self._flushed = False
        self._feed(self.order.accept(datagram, receive_ns))

    def _idle(self) -> None:
        if self._flushed:
            return
        self._feed(self.order.release())
        if time.monotonic() - self.last_datagram_s > FLUSH_S:
            self._flush()

    def _flush(self) -> None:
        self._flushed = True
        for unit in self.demuxer.flush():
            self._place(unit)

    def _feed(self, arrivals: list[Arrival]) -> None:
        for data, receive_ns in arrivals:
            for unit in self.demuxer.feed(data, receive_ns):
                self._place(unit)
        self.order.video_pid = self.demuxer.video_pid

    def _place(self, unit: AccessUnit) -> None:
        placed = self._frames.add(unit)
        if placed.new_epoch:
            self._new_epoch(unit.receive_ns)
        if placed.frame is not None:
            self._emit(placed.frame)
