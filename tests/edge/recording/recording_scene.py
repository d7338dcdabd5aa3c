"""Messages and disks for the tests of the recorder."""

from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path

import numpy as np

from drivers.messages import (
    FixQuality,
    GnssFix,
    ImuSample,
    LidarScan,
    NmeaSentence,
    SensorEvent,
    Severity,
    VideoFrame,
)
from edge.config import Config, Recording
from edge.recording.anchor import Anchor
from edge.recording.disk import Disk, DiskFile, Space
from edge.recording.messages import Diagnostics, DiagnosticStatus, Level, Mark

UTC_NS = 1_790_000_000_000_000_000
MS = 1_000_000
S = 1_000_000_000


def limits(**changes) -> Config:
    """A configuration that does not look at how full the test machine's disk is."""
    return Config(recording=Recording(**{"min_free_mib": 0, "min_free_percent": 0.0, **changes}))


def scan(at_ns: int, points: int = 200) -> LidarScan:
    octets = np.full((3, points), at_ns // MS % 256, np.uint8)
    xyz = np.full((points, 3), at_ns % 1000, np.float32)
    return LidarScan(at_ns, at_ns + MS, xyz, *octets, np.arange(points, dtype=np.uint32))


def imu(at_ns: int) -> ImuSample:
    return ImuSample(at_ns, at_ns + MS, (0.1, 0.2, 0.3), (0.0, 0.0, 9.81))


def fix(at_ns: int, quality: FixQuality = FixQuality.RTK_FIXED) -> GnssFix:
    return GnssFix(at_ns, at_ns + MS, UTC_NS, False, quality, 47.0, 8.0, 500.0, 47.0, 12, 0.8, 1.0, (1.0,) * 3, "gst")


def nmea(at_ns: int) -> NmeaSentence:
    return NmeaSentence(at_ns, at_ns + MS, f"$GNGGA,{at_ns},,,,,,,,,,,,,*00")


def video(at_ns: int, size: int = 1000) -> VideoFrame:
    return VideoFrame(at_ns, at_ns + MS, bytes(size), True, at_ns // 11_111)


def event(at_ns: int, text: str = "rebooted") -> SensorEvent:
    return SensorEvent(at_ns, at_ns + MS, "livox", Severity.WARNING, text)


def diagnostics(at_ns: int) -> Diagnostics:
    status = DiagnosticStatus("livox", Level.OK, "fine", "47MDK", (("points.lost", "3"),))
    return Diagnostics(at_ns, at_ns + MS, (status,))


def second(from_ns: int, points: int = 200, video_bytes: int = 1000) -> list:
    """One second of the payload in order of arrival."""
    made = [imu(from_ns + k * 5 * MS) for k in range(200)]
    made += [scan(from_ns + k * 100 * MS, points) for k in range(10)]
    made += [fix(from_ns + k * 100 * MS) for k in range(10)]
    made += [
        NmeaSentence(from_ns + k * 25 * MS, from_ns + k * 25 * MS + MS, f"$GNGGA,{k},,,,,,,,,,,,,*00")
        for k in range(40)
    ]
    made += [video(from_ns + k * 33 * MS, video_bytes) for k in range(30)]
    made += [diagnostics(from_ns), event(from_ns + 400 * MS), Mark(from_ns + 500 * MS, from_ns + 501 * MS, "tree")]
    return sorted(made, key=lambda message: message.receive_ns)


class FakeClock:
    """Host time that moves when told to."""

    def __init__(self, now_ns: int = 0) -> None:
        self.now_ns = now_ns

    def __call__(self) -> int:
        return self.now_ns

    def anchor(self) -> Anchor:
        return Anchor(UTC_NS, self.now_ns)


class FaultyFile(DiskFile):
    """Asks its disk before each write and sync."""

    def __init__(self, path: Path, disk: FaultyDisk) -> None:
        super().__init__(path)
        self._disk = disk

    def write(self, data: bytes) -> int:
        room = self._disk.before_write(self.path, len(data))
        if room < len(data):
            super().write(bytes(memoryview(data)[:room]))
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)

    def sync(self) -> None:
        self._disk.before_sync(self.path)


class FaultyDisk(Disk):
    """A real folder with a quota, a free-space figure of its own and hooks. Never really syncs, so tests are quick."""

    def __init__(self) -> None:
        self.quota_bytes = 1 << 40
        self.free_bytes = 100 << 30
        self.on_sync: Callable[[Path], None] = lambda _: None
        self.on_write: Callable[[Path], None] = lambda _: None

    def create(self, path: Path) -> DiskFile:
        return FaultyFile(path, self)

    def before_write(self, path: Path, size: int) -> int:
        self.on_write(path)
        room = min(size, self.quota_bytes)
        self.quota_bytes -= room
        return room

    def before_sync(self, path: Path) -> None:
        self.on_sync(path)

    def remove(self, path: Path) -> None:
        if path.exists():
            self.quota_bytes += path.stat().st_size
        super().remove(path)

    def sync_folder(self, folder: Path) -> None:
        pass

    def space(self, folder: Path) -> Space:
        return Space(1 << 40, self.free_bytes)
