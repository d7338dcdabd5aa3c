"""The emulated HERO8 on the network: HTTP, keep-alive, and MPEG-TS over UDP to whoever asked for it.

`run` is the entry for a process of its own; `Emulator` can be started and stopped in a thread.
"""

from __future__ import annotations

import json
import logging
import queue
import socket
import socketserver
import threading
import time
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from random import Random
from typing import TextIO

from drivers.errors import SimulationError
from drivers.sim.camera import PREVIEW_LATENCY_S
from drivers.sim.faults import FaultPlan
from drivers.sim.gopro_device import Hero8, Quirks
from drivers.sim.gopro_line import BadLine, StreamClock
from drivers.sim.sources import StopFlag, VideoSource
from drivers.sim.transport_mux import PACKET, TransportMux

logger = logging.getLogger(__name__)
FRAME_NS = (1001 * 1_000_000_000, 30_000)
DATAGRAM = 7 * PACKET
AHEAD = 150
"""Frames made ahead of their time, so that what starts beside the camera may take the processor for some seconds."""
TRUTH_EVERY = 3
AUDIO_TICKS = 1920
"""1024 samples at 48 kHz, in 90 kHz ticks."""
PRIVATE_EVERY = 30


def run(
    source: VideoSource,
    plan: FaultPlan,
    *,
    stop: StopFlag,
    epoch_ns: int,
    address: str = "127.0.1.30",
    http_port: int = 8080,
    stream_port: int = 8554,
    truth: Path | None = None,
    quirks: Quirks | None = None,
    seed: int = 0,
) -> None:
    """Be the camera until `stop`. epoch_ns: host monotonic time of walk time 0. SimulationError: ports taken."""
    emulator = Emulator(source, plan, epoch_ns, address, http_port, stream_port, truth, quirks, seed)
    emulator.start()
    try:
        stop.wait()
    finally:
        emulator.stop()


class Emulator:
    """The camera and its threads: HTTP server, keep-alive ear, frame maker, sender."""

    def __init__(  # noqa: PLR0917 - one value a fact, all named by `run`
        self,
        source: VideoSource,
        plan: FaultPlan,
        epoch_ns: int,
        address: str,
        http_port: int = 0,
        stream_port: int = 8554,
        truth: Path | None = None,
        quirks: Quirks | None = None,
        seed: int = 0,
        origin_ns: int | None = None,
    ) -> None:
        """http_port 0: any free one, see `http_port` after `start`. origin_ns: of the stream clock, else random."""
        self.device = Hero8(time.monotonic, quirks)
        self.lock = threading.Lock()
        """Around `device`."""
        self.sent: int = 0
        """Frames sent."""
        self._source = source
        self._plan = plan
        self._epoch_ns = epoch_ns
        self._address = address
        self._http_port = http_port
        self._stream_port = stream_port
        self._truth_path = truth
        random = Random(seed)
        self._line = BadLine(plan, random)
        self._clock = StreamClock(plan, random, origin_ns)
        self._random = random
        self._frames: queue.Queue[tuple[int, bytes]] = queue.Queue(AHEAD)
        self._stopping = threading.Event()
        self._threads: list[threading.Thread] = []
        self._mux = TransportMux()
        self._streams = 0
        self._tail = b""
        self._audio_pts = 0
        self._due_s = 0.0

    @property
    def http_port(self) -> int:
        """As bound."""
        return int(self._server.server_address[1])

    def start(self) -> None:
        """Open the ports and go. SimulationError says which port is taken."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((self._address, self._stream_port))
            self._server = _Server((self._address, self._http_port), self)
        except OSError as error:
            self._socket.close()
            raise SimulationError(f"emulated GoPro cannot open its ports on {self._address}: {error}") from error
        self._socket.settimeout(0.2)
        jobs = (("http", self._serve), ("ear", self._listen), ("maker", self._make), ("sender", self._send))
        for name, job in jobs:
            thread = threading.Thread(target=job, name=f"gopro-emulator-{name}", daemon=True)
            thread.start()
            self._threads.append(thread)

    def stop(self) -> None:
        """End and join all threads."""
        self._stopping.set()
        self._server.shutdown()
        for thread in self._threads:
            thread.join()
        self._server.server_close()
        self._socket.close()

    def reachable(self) -> bool:
        """Whether the camera is on the network now."""
        with self.lock:
            return self.device.up and not self._plan.active("disconnect", self._t_s())

    def _t_s(self) -> float:
        return (time.monotonic_ns() - self._epoch_ns) / 1e9

    def _serve(self) -> None:
        self._server.serve_forever(poll_interval=0.1)

    def _listen(self) -> None:
        while not self._stopping.is_set():
            try:
                datagram = self._socket.recv(2048)
            except TimeoutError:
                continue
            except OSError as error:  # an ICMP answer to our own stream
                logger.debug("keep-alive ear: %s", error)
                continue
            if self.reachable():
                with self.lock:
                    self.device.heard(datagram)

    def _make(self) -> None:
        index = 0
        while not self._stopping.is_set():
            # A camera that cannot keep up leaves frames out; it does not fall behind.
            due = int((self._t_s() - PREVIEW_LATENCY_S) * 1e9) * FRAME_NS[1] // FRAME_NS[0]
            index = max(index, due)
            frame = (index, self._source.access_unit(index)[0])
            index += 1
            while not self._stopping.is_set():
                try:
                    self._frames.put(frame, timeout=0.2)
                except queue.Full:
                    continue
                break

    def _send(self) -> None:
        truth = self._truth_path.open("w", encoding="utf-8") if self._truth_path else None
        try:
            while not self._stopping.is_set():
                try:
                    index, unit = self._frames.get(timeout=0.2)
                except queue.Empty:
                    continue
                self._frame(index, unit, truth)
        finally:
            if truth is not None:
                truth.close()

    def _frame(self, index: int, unit: bytes, truth: TextIO | None) -> None:
        t_ns = index * FRAME_NS[0] // FRAME_NS[1]
        t_s = t_ns / 1e9
        if self._plan.due("reboot", t_s):
            with self.lock:
                self.device.reboot()
            self._clock.reboot()
        sensor_ns = self._clock.at(t_ns)
        if truth is not None and index % TRUTH_EVERY == 0:
            truth.write(json.dumps({"host_ns": self._epoch_ns + t_ns, "sensor_ns": sensor_ns}) + "\n")
            truth.flush()
        self._due_s = max(self._due_s, self._epoch_ns / 1e9 + t_s + PREVIEW_LATENCY_S + self._line.delay_s(t_s))
        self._stopping.wait(max(0.0, self._due_s - time.monotonic()))
        self._stream(index, unit, sensor_ns * 9 // 100_000, t_s)

    def _stream(self, index: int, unit: bytes, pts: int, t_s: float) -> None:
        with self.lock:
            target, streams = self.device.stream_to, self.device.streams
        if target is None or self._plan.active("stall", t_s) or self._plan.active("disconnect", t_s):
            return
        if streams != self._streams:
            self._streams, self._mux, self._tail, self._audio_pts = streams, TransportMux(), b"", pts
        data = self._tail + self._mux.video(unit, pts) + self._sound(pts)
        if index % PRIVATE_EVERY == 0:
            data += self._mux.private(self._random.randbytes(100))
        whole = len(data) // DATAGRAM * DATAGRAM
        self._tail = data[whole:]
        arriving = self._line.rubbish(t_s, FRAME_NS[0] / FRAME_NS[1] / 1e9)
        for at in range(0, whole, DATAGRAM):
            arriving += self._line.carry(data[at : at + DATAGRAM], t_s)
        for datagram in arriving:
            self._put(datagram, target)
        self.sent += 1

    def _sound(self, pts: int) -> bytes:
        if not 0 <= pts - self._audio_pts < 90_000:
            self._audio_pts = pts
        packets = b""
        while self._audio_pts <= pts:
            packets += self._mux.audio(self._audio_pts)
            self._audio_pts += AUDIO_TICKS
        return packets

    def _put(self, datagram: bytes, target: str) -> None:
        try:
            self._socket.sendto(datagram, (target, self._stream_port))
        except OSError as error:  # nobody there, or no buffer: a camera would not notice either
            logger.debug("stream datagram not sent: %s", error)


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = True

    def __init__(self, address: tuple[str, int], emulator: Emulator) -> None:
        self.emulator = emulator
        super().__init__(address, _Handler)


class _Handler(BaseHTTPRequestHandler):
    timeout = 3.0
    server: _Server

    def do_GET(self) -> None:
        emulator = self.server.emulator
        self.close_connection = True
        if not emulator.reachable():
            return
        with emulator.lock:
            reply = emulator.device.ask(self.path, self.client_address[0])
        self.send_response(reply.code)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(reply.body)))
        self.end_headers()
        self.wfile.write(reply.body)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - as inherited
        logger.debug(format, *args)
