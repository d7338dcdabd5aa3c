"""Live view over Foxglove's WebSocket protocol: the same topics, types and bytes as in the file.

Newest wins: what viewers are too slow for is thrown away, and the recorder never waits for them.
"""

from __future__ import annotations

import importlib
import logging
import threading
import time
from collections import deque
from typing import Any

from drivers.messages import LidarScan
from edge.config import Config
from edge.recording.anchor import Anchor
from edge.recording.calibration import load_calibration
from edge.recording.messages import Recordable
from edge.ros.encode import ENCODERS, encode_transforms
from edge.ros.schemas import schema_text
from edge.ros.topics import Channel, channels, tf_static_channel

log = logging.getLogger(__name__)

QUEUE_LENGTH = 256
"""About a second of everything; a scan is 0.4 MB, so 4 MB at most."""
_TRANSFORMS_EVERY_S = 1.0
"""Viewers come at any time, and have no latched topics."""
_WAKE_S = 0.02
"""The queue is emptied 50 times a second, so `offer` need not wake anybody: that would cost the driver threads."""


class LiveView:
    """Shows what passes through `offer` to whoever connects, between `start` and `stop`."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._anchor = Anchor.now()
        self._queue: deque[Recordable] = deque(maxlen=QUEUE_LENGTH)
        self._scan_period_ns = int(1e9 / config.live.lidar_hz)
        self._next_scan_ns = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)
        self._server: Any = None
        self._context: Any = None
        self._channels: dict[type, Any] = {}
        self.problem = ""
        """Why there is no live view, and what to do; empty when there is."""

    @property
    def port(self) -> int:
        """Where it listens; 0 when it does not."""
        return int(self._server.port) if self._server is not None else 0

    def start(self) -> None:
        """Open the server; what goes wrong is told in `problem`, never raised: the live view is optional."""
        try:
            foxglove = importlib.import_module("foxglove")
        except ImportError:
            self._fail("live view: foxglove-sdk is not installed; run `pip install 'mapforest[live]'`")
            return
        try:
            self._open(foxglove)
        except (OSError, RuntimeError, ValueError) as error:
            live = self._config.live
            self._fail(f"live view: cannot listen at {live.host}:{live.port}: {error}; change live.host or live.port")
            return
        self._thread.start()

    def stop(self) -> None:
        """Hang up on everyone. Idempotent."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(2.0)
        if self._server is not None:
            self._server.stop()
            self._server = None

    def offer(self, message: Recordable) -> None:
        """Take a message. Any thread; returns at once."""
        if type(message) is LidarScan:
            if message.receive_ns < self._next_scan_ns:
                return
            self._next_scan_ns = message.receive_ns + self._scan_period_ns
        self._queue.append(message)

    def _fail(self, problem: str) -> None:
        self.problem = problem
        self._queue = deque(maxlen=0)
        log.warning("%s", problem)

    def _open(self, foxglove: Any) -> None:
        live = self._config.live
        context = self._context = foxglove.Context()  # its channels close when nobody holds it
        kinds = channels(self._config.topics)
        opened: dict[str, Any] = {}
        for kind, channel in kinds.items():
            if channel.topic not in opened:
                opened[channel.topic] = _open_channel(foxglove, context, channel)
            self._channels[kind] = opened[channel.topic]
        self._static = _open_channel(foxglove, context, tf_static_channel(self._config.topics))
        self._transforms = load_calibration(self._config.calibration).transforms
        self._server = foxglove.start_server(
            name="mapforest", host=live.host, port=live.port, context=context, message_backlog_size=QUEUE_LENGTH
        )

    def _run(self) -> None:
        """Thread root."""
        try:
            next_transforms_s = 0.0
            while not self._stop.wait(_WAKE_S):
                if time.monotonic() >= next_transforms_s:
                    next_transforms_s = time.monotonic() + _TRANSFORMS_EVERY_S
                    stamp_ns = self._anchor.session_ns(time.monotonic_ns())
                    self._static.log(encode_transforms(self._transforms, stamp_ns), log_time=stamp_ns)
                self._send_queued()
        except Exception as error:  # the thread's root: a viewer's trouble is not the recorder's
            log.exception("live view died")
            self._fail(f"live view: ended by an error ({error!r}); restart the recorder to have it back")

    def _send_queued(self) -> None:
        while self._queue:
            message = self._queue.popleft()
            channel = self._channels.get(type(message))
            if channel is not None and channel.has_sinks():
                payload = ENCODERS[type(message)](message, self._anchor.session_ns(message.stamp_ns))
                channel.log(payload, log_time=self._anchor.session_ns(message.receive_ns))


def _open_channel(foxglove: Any, context: Any, channel: Channel) -> Any:
    schema = foxglove.Schema(name=channel.type_name, encoding="ros2msg", data=schema_text(channel.type_name))
    return foxglove.Channel(channel.topic, schema=schema, message_encoding="cdr", context=context)
