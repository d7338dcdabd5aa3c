"""A Mid-360 that sends canned packets: counters and times are written into them, everything else is made before."""

from __future__ import annotations

import contextlib
import zlib
from multiprocessing.sharedctypes import Synchronized

import numpy as np
import numpy.typing as npt

from benchmarks.recording.load import RETURNS_PER_PACKET, Load
from drivers.livox.keys import Key
from drivers.livox.packets import CRC_OFFSET, CRC_START, POINTS_PER_PACKET, DataType
from drivers.sim import livox_emulator
from drivers.sim.faults import FaultPlan
from drivers.sim.livox_device import DeviceOptions
from drivers.sim.livox_packets import imu_packet, point_packets
from drivers.sim.sources import PointBlock

CANNED = 2048
"""Packets made before, a second of them at the full rate; a power of two, so that the counter's wrap fits."""
INTERVAL, COUNT, STAMP = slice(3, 5), slice(7, 9), slice(28, 36)


class CannedLidar(livox_emulator.Emulator):
    """The emulated Mid-360 with its control port and status; its streams are sent as cheaply as can be."""

    def __init__(self, load: Load, epoch_ns: int, pause_s: Synchronized[float]) -> None:
        """pause_s: takes the longest time between two sendings, which shows a sender that was starved."""
        options = DeviceOptions(stored_host=load.host)
        super().__init__(_Nothing(), _Nothing(), FaultPlan("livox", ()), epoch_ns, address=load.lidar, options=options)
        self._load = load
        self._pause_s = pause_s
        self._last_ns = 0
        self._packets = _canned(load)
        self._rows = [memoryview(row) for row in self._packets]
        self._imu = bytearray(imu_packet((0.01, -0.02, 0.03), (0.01, 0.02, 1.0), 0, 0))
        self._points_sent = self._imu_sent = 0
        self._began_ns = 0
        self._sensor_ns = 0
        self.sent = 0
        """Data packets that left."""

    def _stream(self, now_ns: int, paused: bool) -> None:
        if paused:
            self._began_ns = 0
            return
        if not self._began_ns:
            self._began_ns, self._points_sent, self._imu_sent, self._last_ns = now_ns, 0, 0, now_ns
            self._sensor_ns = now_ns - self.device.machine.power_on_ns
        self._pause_s.value = max(self._pause_s.value, (now_ns - self._last_ns) / 1e9)
        self._last_ns = now_ns
        self._send_points(now_ns - self._began_ns)
        self._send_imu(now_ns - self._began_ns)

    def _send_points(self, elapsed_ns: int) -> None:
        """What is complete by now."""
        load, first = self._load, self._points_sent
        due = min(elapsed_ns // load.packet_ns - first, CANNED)
        if due <= 0:
            return
        numbers = np.arange(first, first + due)
        rows = numbers % CANNED
        self._packets[rows, COUNT] = (numbers & 0xFFFF).astype("<u2")[:, None].view(np.uint8)
        stamps = self._sensor_ns + numbers * load.packet_ns
        self._packets[rows, STAMP] = stamps.astype("<u8")[:, None].view(np.uint8)
        send, to = self.points.socket.sendto, self._to(Key.POINT_HOST)
        for row in rows.tolist():
            with contextlib.suppress(OSError):  # nobody listens yet
                send(self._rows[row], to)
        self._points_sent += due
        self.sent += due

    def _send_imu(self, elapsed_ns: int) -> None:
        packet = self._imu
        while self._imu_sent * self._load.imu_ns <= elapsed_ns:
            packet[COUNT] = (self._imu_sent & 0xFFFF).to_bytes(2, "little")
            packet[STAMP] = (self._sensor_ns + self._imu_sent * self._load.imu_ns).to_bytes(8, "little")
            packet[CRC_OFFSET:CRC_START] = zlib.crc32(memoryview(packet)[CRC_START:]).to_bytes(4, "little")
            with contextlib.suppress(OSError):
                self.imu.socket.sendto(packet, self._to(Key.IMU_HOST))
            self._imu_sent += 1
            self.sent += 1

    def _to(self, key: Key) -> tuple[str, int]:
        host = self.device.setting(key)
        return host.address, host.port


class _Nothing:
    """The source of a stream that is canned."""

    def cast(self, t_ns: int, count: int) -> PointBlock:
        raise NotImplementedError

    def sample(self, t_ns: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        raise NotImplementedError


def _canned(load: Load) -> npt.NDArray[np.uint8]:
    """(CANNED, packet bytes): points of a room of 40 m, no-returns anywhere among them."""
    random = np.random.default_rng(7)
    shape = (CANNED, POINTS_PER_PACKET)
    xyz_mm = random.integers(-20_000, 20_000, (*shape, 3), dtype=np.int32)
    xyz_mm[..., 0] |= 1  # a return is never at the origin
    silent = np.argsort(random.random(shape), axis=1)[:, RETURNS_PER_PACKET:]
    np.put_along_axis(xyz_mm, silent[..., None], 0, axis=1)
    levels = random.integers(0, 255, CANNED * POINTS_PER_PACKET, dtype=np.uint8)
    block = PointBlock(xyz_mm.reshape(-1, 3), levels, np.zeros_like(levels))
    packets = point_packets(block, DataType.CARTESIAN_32, np.zeros(CANNED, np.int64), 0)
    span = load.point_ns * (POINTS_PER_PACKET - 1) // 100
    packets[:, INTERVAL] = np.frombuffer(span.to_bytes(2, "little"), np.uint8)
    return packets
