"""Scans: the points of 100 ms each, cut on the LiDAR's own clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from drivers.livox.packets import INTERVAL_UNIT_NS, returned, xyz_m
from drivers.messages import LidarScan

PERIOD_NS = 100_000_000
SLACK_NS = 5_000_000
"""A window stays open this long after its end for packets that were overtaken."""
LASERS = 4
"""Fire in turn: line = index in the packet % 4 (reference sheet, section 7)."""


@dataclass(frozen=True, slots=True)
class PointPackets:
    """Point packets of one type and length.

    sensor_ns, interval (0.1 us), receive_ns: (n,) int64. records: (n, points per packet), a copy.
    """

    data_type: int
    sensor_ns: npt.NDArray[np.int64]
    interval: npt.NDArray[np.int64]
    receive_ns: npt.NDArray[np.int64]
    records: npt.NDArray[Any]

    def where(self, chosen: npt.NDArray[Any] | slice) -> PointPackets:
        """The packets of a mask, in the order of an index, or of a slice (without copying)."""
        return PointPackets(
            self.data_type,
            self.sensor_ns[chosen],
            self.interval[chosen],
            self.receive_ns[chosen],
            self.records[chosen],
        )

    def last_point_ns(self) -> npt.NDArray[np.int64]:
        """(n,) sensor time of the last point of each packet."""
        return np.asarray(self.sensor_ns + self.interval * INTERVAL_UNIT_NS, np.int64)

    def point_ns(self) -> npt.NDArray[np.int64]:
        """(n, points) sensor time of each point: the interval spans from the first point to the last."""
        slots = self.records.shape[1]
        steps = np.arange(slots, dtype=np.int64) * INTERVAL_UNIT_NS
        return np.asarray(self.sensor_ns[:, None] + self.interval[:, None] * steps // max(slots - 1, 1), np.int64)


class ScanAssembler:
    """Collects packets into scans. Windows follow each other by their period, whatever packets come or do not.

    `to_host_ns` maps the sensor's time; it is asked once a window, when its first packet comes.
    """

    def __init__(self, to_host_ns: Callable[[int], int], emit: Callable[[LidarScan], None]) -> None:
        self._to_host_ns = to_host_ns
        self._emit = emit
        self._pending: list[PointPackets] = []
        self._start_ns: int | None = None
        self._stamp_ns = 0
        self.scans = 0
        self.too_late = 0
        """Packets that came after their scan had gone out."""

    def add(self, packets: PointPackets) -> None:
        """Take packets in, in any order; scans that are complete go out."""
        if len(packets.sensor_ns) == 0:
            return
        start_ns = self._start_ns
        if start_ns is None:
            start_ns = self._open(int(packets.sensor_ns.min()))
        last_ns = packets.last_point_ns()
        if last_ns.min() < start_ns:
            self.too_late += int((last_ns < start_ns).sum())
            packets = packets.where(last_ns >= start_ns)
        self._pending.append(packets)
        newest_ns = int(last_ns.max())
        while self._start_ns is not None and newest_ns >= self._start_ns + PERIOD_NS + SLACK_NS:
            self._close()

    def flush(self) -> None:
        """Send out what there is, and begin anew with the next packet (silence, a jump of the clock, the end)."""
        while self._start_ns is not None and self._pending:
            self._close()
        self._start_ns = None

    def _open(self, start_ns: int) -> int:
        self._start_ns = start_ns
        self._stamp_ns = self._to_host_ns(start_ns)
        return start_ns

    def _close(self) -> None:
        """End the window: its points go out, later ones wait, and the next window with packets opens."""
        assert self._start_ns is not None
        end_ns = self._start_ns + PERIOD_NS
        inside, waiting = [], []
        for packets in _grouped(self._pending):
            begun = int(np.searchsorted(packets.sensor_ns, end_ns))
            over = int(np.searchsorted(packets.last_point_ns(), end_ns))
            inside.append(packets.where(slice(0, begun)))
            waiting.append(packets.where(slice(over, None)))
        inside = [packets for packets in inside if len(packets.sensor_ns)]
        self._pending = [packets for packets in waiting if len(packets.sensor_ns)]
        if inside:
            self._send(inside, self._start_ns, end_ns)
        first_ns = min((int(packets.sensor_ns.min()) for packets in self._pending), default=end_ns)
        skipped = max(0, (first_ns - end_ns) // PERIOD_NS)
        self._open(end_ns + skipped * PERIOD_NS)

    def _send(self, packets: list[PointPackets], start_ns: int, end_ns: int) -> None:
        columns = [_points_of(group, start_ns, end_ns) for group in packets]
        offset_ns, xyz, reflectivity, tag, line = (np.concatenate(column) for column in zip(*columns, strict=True))
        if len(columns) > 1:  # the point type was changed within the window
            order = np.argsort(offset_ns, kind="stable")
            offset_ns, xyz, reflectivity, tag, line = (c[order] for c in (offset_ns, xyz, reflectivity, tag, line))
        receive_ns = max(int(part.receive_ns.max()) for part in packets)
        self.scans += 1
        self._emit(LidarScan(self._stamp_ns, receive_ns, xyz, reflectivity, tag, line, offset_ns))


def _grouped(packets: list[PointPackets]) -> list[PointPackets]:
    """Packets joined by type and length, in order of their time, each once."""
    groups: dict[tuple[int, int], list[PointPackets]] = {}
    for part in packets:
        groups.setdefault((part.data_type, part.records.shape[1]), []).append(part)
    return [_joined(data_type, parts) for (data_type, _), parts in groups.items()]


def _joined(data_type: int, parts: list[PointPackets]) -> PointPackets:
    sensor_ns = np.concatenate([part.sensor_ns for part in parts])
    joined = PointPackets(
        data_type,
        sensor_ns,
        np.concatenate([part.interval for part in parts]),
        np.concatenate([part.receive_ns for part in parts]),
        np.concatenate([part.records for part in parts]),
    )
    if (np.diff(sensor_ns) > 0).all():
        return joined
    return joined.where(np.unique(sensor_ns, return_index=True)[1])


def _points_of(packets: PointPackets, start_ns: int, end_ns: int) -> tuple[npt.NDArray[Any], ...]:
    """Columns offset_ns, xyz_m, reflectivity, tag, line of the returns in [start_ns, end_ns)."""
    point_ns = packets.point_ns().ravel()
    points: npt.NDArray[Any] = packets.records.ravel()
    line = np.resize(np.arange(packets.records.shape[1]) % LASERS, points.shape).astype(np.uint8)
    wanted = (point_ns >= start_ns) & (point_ns < end_ns) & returned(points, packets.data_type)
    points = points[wanted]
    return (
        (point_ns[wanted] - start_ns).astype(np.uint32),
        xyz_m(points, packets.data_type),
        points["reflectivity"].copy(),
        points["tag"].copy(),
        line[wanted],
    )
