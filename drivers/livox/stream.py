"""From received blocks to messages: checks, loss counters, the one clock of points and IMU, scans."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from drivers.clock import ClockState, ClockStep, SensorClock
from drivers.driver import Emit
from drivers.livox.counter import PacketCounter, Verdict
from drivers.livox.meter import RateMeter
from drivers.livox.order import Sample, SampleOrder
from drivers.livox.packets import (
    HEADER,
    INTERVAL_UNIT_NS,
    PACKET_NS,
    STANDARD_GRAVITY,
    DataType,
    checksum_holds,
    headers,
    records,
    well_formed,
)
from drivers.livox.receive import Block
from drivers.livox.scan import PointPackets, ScanAssembler
from drivers.livox.status import TIME_SOURCES
from drivers.messages import ImuSample, LidarScan

IMU_NS = 5_000_000
"""Mean period of the IMU; single periods vary from 3.0 to 6.9 ms."""
_IMU = struct.Struct("<6f")
WANTED = (Verdict.NEW, Verdict.LATE, Verdict.JUMPED)


class StreamDecoder:
    """Decodes blocks and emits scans and IMU samples. One thread calls `decode` and `flush`; all else may be read.

    `on_jump(step, receive_ns)` is told of each jump of the LiDAR's clock or counters, and `on_sync(source, receive_ns)`
    of each change of what disciplines the clock, by the packets' own word.
    """

    def __init__(
        self,
        emit: Emit,
        on_jump: Callable[[ClockStep | None, int], None],
        on_sync: Callable[[str, int], None],
        latency_ns: int = 0,
    ) -> None:
        self._emit = emit
        self._on_jump = on_jump
        self._on_sync = on_sync
        self._clock = SensorClock(latency_ns=latency_ns)
        self._assembler = ScanAssembler(self._clock.to_host_ns, self._emit_scan)
        self._samples = SampleOrder(self._emit_imu)
        self._time_type = 0
        self.points = PacketCounter(PACKET_NS)
        self.imu = PacketCounter(IMU_NS)
        self.scan_meter = RateMeter()
        self.point_meter = RateMeter()
        self.imu_meter = RateMeter()
        self.malformed = 0
        """Datagrams from the LiDAR that are no packets, or fail their checksum."""
        self.clock_state: ClockState | None = None

    @property
    def too_late(self) -> int:
        """Point packets that came after their scan had gone out."""
        return self._assembler.too_late

    def decode(self, block: Block) -> None:
        """Decode the datagrams of a block, in order of their arrival."""
        count = len(block)
        slots, lengths = block.slots[:count], np.array(block.lengths, np.int64)
        head = headers(slots)
        sound = well_formed(head, lengths)
        receive_ns = np.array(block.receive_ns, np.int64)
        order = np.argsort(receive_ns, kind="stable")
        for row in np.flatnonzero(sound & (head["crc32"] != 0)).tolist():
            sound[row] = checksum_holds(block.rows[row], block.lengths[row], int(head["crc32"][row]))
        rows = order[sound[order]].tolist()
        self.malformed += count - len(rows)
        for run in self._runs(block, head, rows):
            self._collect(slots, head, receive_ns, run)
        self.clock_state = self._clock.state()

    def flush(self) -> None:
        """Send out the unfinished scan: the stream fell silent, or the driver stops."""
        self._samples.release()
        self._assembler.flush()

    def _runs(self, block: Block, head: npt.NDArray[Any], rows: list[int]) -> Iterator[list[int]]:
        """Rows of the point packets to keep, cut where the sensor's clock jumped; IMU samples go out on the way."""
        run: list[int] = []
        columns = [head[name].tolist() for name in ("data_type", "udp_cnt", "timestamp", "time_interval", "time_type")]
        for row in rows:
            data_type, udp_cnt, sensor_ns, interval, time_type = (column[row] for column in columns)
            arrival_ns = block.receive_ns[row]
            inertial = data_type == DataType.IMU
            counter = self.imu if inertial else self.points
            lost = counter.lost
            verdict = counter.take(udp_cnt, sensor_ns, arrival_ns)
            if verdict not in WANTED:
                continue
            if verdict is Verdict.JUMPED:  # what came before goes out by the clock of before
                yield run
                run = []
                self._finish_line()
            step = self._clock.observe(sensor_ns + interval * INTERVAL_UNIT_NS, arrival_ns)
            if verdict is Verdict.JUMPED or step is not None:
                yield run
                run = []
                self._finish_line()
                self._on_jump(step, arrival_ns)
            if time_type != self._time_type:
                self._time_type = time_type
                self._on_sync(TIME_SOURCES.get(time_type, f"type {time_type}"), arrival_ns)
            if inertial:
                values = _IMU.unpack_from(block.rows[row], HEADER.itemsize)
                if not self._samples.take(Sample(sensor_ns, arrival_ns, values), counter.lost - lost):
                    counter.lost += 1
            else:
                run.append(row)
        yield run

    def _finish_line(self) -> None:
        """Send out all there is of the device's present line of time."""
        self._samples.restart()
        self._assembler.flush()

    def _collect(
        self, slots: npt.NDArray[np.uint8], head: npt.NDArray[Any], receive_ns: npt.NDArray[np.int64], run: list[int]
    ) -> None:
        """Hand point packets to the assembler, one group a type and length (nearly always one)."""
        if not run:
            return
        chosen = np.array(run, np.intp)
        self.point_meter.mark(*receive_ns[chosen].tolist())
        kinds = head["data_type"][chosen].astype(np.int64) << 16 | head["dot_num"][chosen]
        for kind in set(kinds.tolist()):
            rows = chosen[kinds == kind]
            data_type, dots = kind >> 16, kind & 0xFFFF
            self._assembler.add(
                PointPackets(
                    data_type,
                    head["timestamp"][rows].astype(np.int64),
                    head["time_interval"][rows].astype(np.int64),
                    receive_ns[rows],
                    records(slots, rows, data_type, dots),
                )
            )

    def _emit_imu(self, sample: Sample) -> None:
        gx, gy, gz, ax, ay, az = sample.values
        self.imu_meter.mark(sample.receive_ns)
        acceleration = (ax * STANDARD_GRAVITY, ay * STANDARD_GRAVITY, az * STANDARD_GRAVITY)
        stamp_ns = self._clock.to_host_ns(sample.sensor_ns)
        self._emit(ImuSample(stamp_ns, sample.receive_ns, (gx, gy, gz), acceleration))

    def _emit_scan(self, scan: LidarScan) -> None:
        self.scan_meter.mark(scan.receive_ns)
        self._emit(scan)
