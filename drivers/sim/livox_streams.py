"""The two data streams of the emulated LiDAR: what to send by now."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from drivers.livox.packets import PACKET_NS, POINTS_PER_PACKET
from drivers.sim.livox_oscillator import Oscillator
from drivers.sim.livox_packets import imu_packet, point_packets
from drivers.sim.sources import ImuSource, LidarSource, PointBlock

BLOCK_PACKETS = 20
"""Cast at a time: 9.6 ms."""
BLOCKS_AHEAD = 4
LAST_POINT_NS = 475_000
TIMESTAMP = slice(28, 36)
HOPELESS_NS = 1_000_000_000
"""Behind real time by this much, packets are skipped, and show as lost."""
IMU_NS = 5_000_000
IMU_JITTER_NS = 950_000
"""Each sample is off its grid by up to this much: periods of 3.1 to 6.9 ms, 200 Hz in the mean."""


@dataclass(slots=True)
class _Job:
    """A block being cast: its first packet by number since the stream began."""

    first: int
    future: Future[PointBlock]


class PointStream:
    """Point packets every 480 us of the device's oscillator, cast a few blocks ahead in a thread of its own."""

    def __init__(self, source: LidarSource, oscillator: Oscillator, epoch_ns: int, caster: ThreadPoolExecutor) -> None:
        self._source = source
        self._oscillator = oscillator
        self._epoch_ns = epoch_ns
        self._caster = caster
        self._jobs: deque[_Job] = deque()
        self._ready: deque[tuple[int, memoryview]] = deque()
        self._start_ticks = 0
        self._next = 0
        self.count = 0
        self.skipped = 0
        self.latest_ns = 0
        """The longest that a packet had to wait for its block, or for this process to get its turn."""

    def end(self) -> None:
        """Pause. Packets that were not sent were never made."""
        for job in self._jobs:
            job.future.cancel()
        self._jobs.clear()
        self.count -= len(self._ready)
        self._ready.clear()

    def begin(self, now_ns: int) -> None:
        """Start, or go on after a pause, with a packet that begins now. The counter goes on."""
        self._start_ticks = self._oscillator.ticks_ns(now_ns)
        self._next = 0

    def due(self, now_ns: int, data_type: int) -> Iterator[memoryview]:
        """Packets whose last point was measured by now."""
        ticks_ns = self._oscillator.ticks_ns(now_ns)
        self._skip_hopeless(now_ns)
        self._cast_ahead()
        while True:
            if not self._ready and not self._build(data_type):
                return
            end_ticks, packet = self._ready[0]
            if end_ticks > ticks_ns:
                return
            self._ready.popleft()
            self.latest_ns = max(self.latest_ns, ticks_ns - end_ticks)
            stamp_ns = self._oscillator.stamp_ns(end_ticks - LAST_POINT_NS)
            packet[TIMESTAMP] = stamp_ns.to_bytes(8, "little")  # now: a clock step meets points and IMU together
            yield packet

    def _cast_ahead(self) -> None:
        while len(self._jobs) < BLOCKS_AHEAD:
            walk_ns = max(0, self._oscillator.host_ns(self._ticks_of(self._next)) - self._epoch_ns)
            future = self._caster.submit(self._source.cast, walk_ns, BLOCK_PACKETS * POINTS_PER_PACKET)
            self._jobs.append(_Job(self._next, future))
            self._next += BLOCK_PACKETS

    def _build(self, data_type: int) -> bool:
        """Turn the next block into packets. False while it is still being cast."""
        if not self._jobs or not self._jobs[0].future.done():
            return False
        job = self._jobs.popleft()
        ticks = [self._ticks_of(job.first + index) for index in range(BLOCK_PACKETS)]
        packets = point_packets(job.future.result(), data_type, np.array(ticks), self.count)
        self.count += BLOCK_PACKETS
        self._ready.extend((tick + LAST_POINT_NS, memoryview(row)) for tick, row in zip(ticks, packets, strict=True))
        return True

    def _skip_hopeless(self, now_ns: int) -> None:
        if not self._jobs:
            return
        first = self._jobs[0].first - len(self._ready)
        behind_ns = self._oscillator.ticks_ns(now_ns) - self._ticks_of(first)
        if behind_ns > HOPELESS_NS:
            skipped = behind_ns // PACKET_NS
            self.skipped += skipped
            self.end()
            self.count += skipped
            self.begin(now_ns)

    def _ticks_of(self, packet: int) -> int:
        return self._start_ticks + packet * PACKET_NS


class ImuStream:
    """IMU packets at 200 Hz in the mean, with the irregular period of the hardware."""

    def __init__(self, source: ImuSource, oscillator: Oscillator, epoch_ns: int, seed: int) -> None:
        self._source = source
        self._oscillator = oscillator
        self._epoch_ns = epoch_ns
        self._random = np.random.default_rng(seed)
        self._grid_ticks = 0
        self._next_ticks = 0
        self.count = 0

    def begin(self, now_ns: int) -> None:
        """Start, or go on after a pause. The counter goes on."""
        self._grid_ticks = self._oscillator.ticks_ns(now_ns)
        self._plan_next()

    def due(self, now_ns: int) -> Iterator[bytes]:
        """Packets of the samples taken by now."""
        ticks_ns = self._oscillator.ticks_ns(now_ns)
        while self._next_ticks <= ticks_ns:
            walk_ns = max(0, self._oscillator.host_ns(self._next_ticks) - self._epoch_ns)
            gyro_rad_s, accel_g = self._source.sample(walk_ns)
            yield imu_packet(gyro_rad_s, accel_g, self._oscillator.stamp_ns(self._next_ticks), self.count)
            self.count += 1
            self._plan_next()

    def _plan_next(self) -> None:
        self._grid_ticks += IMU_NS
        self._next_ticks = self._grid_ticks + int(self._random.integers(-IMU_JITTER_NS, IMU_JITTER_NS + 1))
