"""The live view, seen by a viewer that speaks Foxglove's WebSocket protocol (written here from its specification)."""

import json
import os
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from drivers.messages import LidarScan
from edge.config import Config, Live
from edge.service.live import LiveView
from tests.edge.service.fakes import imu
from tests.waiting import PATIENCE_S, wait_for

foxglove = pytest.importorskip("foxglove")

TEXT, BINARY = 1, 2


class Viewer:
    """Enough of RFC 6455 and of foxglove.sdk.v1 to subscribe and to read."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
        self._socket.sendall(
            b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
            b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
        )
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            head += self._read(1)
        assert head.startswith(b"HTTP/1.1 101")
        self.channels: dict[str, dict] = {}

    def close(self) -> None:
        self._socket.close()

    def await_channels(self, count: int) -> None:
        while len(self.channels) < count:
            kind, payload = self._frame()
            if kind == TEXT and (said := json.loads(payload)).get("op") == "advertise":
                self.channels.update({channel["topic"]: channel for channel in said["channels"]})

    def subscribe(self, topic: str) -> None:
        wanted = {"id": 7, "channelId": self.channels[topic]["id"]}
        data = json.dumps({"op": "subscribe", "subscriptions": [wanted]}).encode()
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(data))
        self._socket.sendall(struct.pack("!BB", 0x80 | TEXT, 0x80 | len(data)) + mask + masked)

    def message(self) -> bytes:
        """The next message's payload."""
        while True:
            kind, payload = self._frame()
            if kind == BINARY and payload[0] == 1:
                assert struct.unpack_from("<I", payload, 1) == (7,)
                return payload[13:]

    def _frame(self) -> tuple[int, bytes]:
        first, length = self._read(2)
        if length == 126:
            (length,) = struct.unpack("!H", self._read(2))
        elif length == 127:
            (length,) = struct.unpack("!Q", self._read(8))
        return first & 0xF, self._read(length)

    def _read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            piece = self._socket.recv(count - len(data))
            assert piece
            data += piece
        return data


def config(**live: object) -> Config:
    return Config(live=Live(enabled=True, port=0, **live), sensors={})  # type: ignore[arg-type]


@contextmanager
def shown(live: LiveView) -> Iterator[Viewer]:
    live.start()
    assert live.problem == ""
    viewer = Viewer(live.port)
    try:
        viewer.await_channels(8)
        yield viewer
    finally:
        viewer.close()
        live.stop()


def scan(receive_ns: int) -> LidarScan:
    one = np.ones(1, np.uint8)
    return LidarScan(receive_ns, receive_ns, np.ones((1, 3), np.float32), one, one, one, np.zeros(1, np.uint32))


def test_a_viewer_gets_the_messages_as_ros_types() -> None:
    live = LiveView(config())
    with shown(live) as viewer:
        channel = viewer.channels["/livox/imu"]
        assert (channel["encoding"], channel["schemaName"]) == ("cdr", "sensor_msgs/msg/Imu")
        viewer.subscribe("/livox/imu")
        wait_for(live._channels[type(imu(0))].has_sinks)
        stamp_ns = time.monotonic_ns()
        live.offer(imu(stamp_ns))
        decoded = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(viewer.message(), "sensor_msgs/msg/Imu")
        assert decoded.linear_acceleration.z == 9.81
        sent_ns = decoded.header.stamp.sec * 1_000_000_000 + decoded.header.stamp.nanosec
        assert abs(sent_ns - (stamp_ns + time.time_ns() - time.monotonic_ns())) < 1_000_000_000


def test_scans_are_thinned_out() -> None:
    live = LiveView(config(lidar_hz=2.0))
    for tenth in range(20):
        live.offer(scan(tenth * 100_000_000))
    assert len(live._queue) == 4


def test_what_nobody_takes_is_thrown_away() -> None:
    live = LiveView(config())
    for stamp in range(10_000):
        live.offer(imu(stamp))
    assert len(live._queue) == 256
    assert live._queue[-1].receive_ns == 9_999


def test_a_taken_port_is_told_and_the_recorder_lives_on() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        live = LiveView(config())
        live._config = msgspec.structs.replace(live._config, live=Live(enabled=True, port=taken.getsockname()[1]))
        live.start()
        assert "change live.host or live.port" in live.problem
        live.offer(imu(1))
        assert len(live._queue) == 0
        live.stop()


def test_without_the_package_the_way_to_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr("importlib.import_module", refuse)
    live = LiveView(config())
    live.start()
    assert "pip install" in live.problem
    live.stop()
