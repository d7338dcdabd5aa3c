"""Each sweep with the inertial samples up to its end, from messages that come as they come.

Scans arrive before the samples that cover them, samples arrive late or twice, and either may stop for a while. Nothing
goes back in time; what comes too late is left out and counted, and so are single stamps far from the others.
"""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from dataclasses import dataclass

from drivers.messages import ImuSample, LidarScan
from pipeline.odometry.time_gate import TimeGate

PATIENCE_NS = 400_000_000
"""A scan waits so long, in the time of the stamps, for inertial data that do not come."""
SETTLE_NS = 20_000_000
"""Samples overtake each other by less than this."""
_MOST_SAMPLES = 4000
"""10 s of the fastest IMU: without scans, older samples are of no use to anybody."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """A scan, and the inertial samples since the last sweep's up to the first one at or after its end."""

    scan: LidarScan
    imu: tuple[ImuSample, ...]


@dataclass(slots=True)
class Left:
    """What was left out because it came too late, or twice, or was stamped elsewhere in time."""

    scans: int = 0
    samples: int = 0


class Pairing:
    """Scans and samples in any order within `PATIENCE_NS`, sweeps out in order of time."""

    def __init__(self) -> None:
        self.left = Left()
        self._sample_gate, self._scan_gate = TimeGate[ImuSample](), TimeGate[LidarScan]()
        self._samples: list[ImuSample] = []
        self._scans: list[LidarScan] = []
        self._given_ns = -(1 << 62)
        """Newest sample that was handed on."""
        self._swept_ns = -(1 << 62)
        """Start of the last sweep that was handed on."""
        self._newest_ns = -(1 << 62)

    @property
    def waiting(self) -> int:
        """Scans that wait for inertial data."""
        return len(self._scans)

    def add(self, message: LidarScan | ImuSample) -> Iterator[Sweep]:
        """Take a message; the sweeps that it completes."""
        if isinstance(message, ImuSample):
            for sample in self._sample_gate.admit(message, self._scan_gate.newest_ns):
                self._add_sample(sample)
            self.left.samples += self._sample_gate.newly_refused()
        else:
            for scan in self._scan_gate.admit(message, self._sample_gate.newest_ns):
                self._add_scan(scan)
            self.left.scans += self._scan_gate.newly_refused()
        yield from self._ready()

    def flush(self) -> Iterator[Sweep]:
        """What still waits, with what there is: nothing more will come."""
        while self._scans:
            yield self._sweep()

    def _add_sample(self, sample: ImuSample) -> None:
        if sample.stamp_ns <= self._given_ns:
            self.left.samples += 1
            return
        place = bisect.bisect_left(self._samples, sample.stamp_ns, key=_stamp)
        if place < len(self._samples) and self._samples[place].stamp_ns == sample.stamp_ns:
            self.left.samples += 1
            return
        self._samples.insert(place, sample)
        self._newest_ns = max(self._newest_ns, sample.stamp_ns)
        if len(self._samples) > _MOST_SAMPLES:
            del self._samples[: _MOST_SAMPLES // 4]

    def _add_scan(self, scan: LidarScan) -> None:
        if scan.stamp_ns <= self._swept_ns:
            self.left.scans += 1
            return
        place = bisect.bisect_left(self._scans, scan.stamp_ns, key=_stamp)
        if place < len(self._scans) and self._scans[place].stamp_ns == scan.stamp_ns:
            self.left.scans += 1
            return
        self._scans.insert(place, scan)
        self._newest_ns = max(self._newest_ns, scan.stamp_ns)

    def _ready(self) -> Iterator[Sweep]:
        while self._scans:
            end_ns = end_of(self._scans[0])
            covered = bool(self._samples) and self._samples[-1].stamp_ns >= end_ns + SETTLE_NS
            if not covered and self._newest_ns < end_ns + PATIENCE_NS:
                return
            yield self._sweep()

    def _sweep(self) -> Sweep:
        scan = self._scans.pop(0)
        upto = bisect.bisect_left(self._samples, end_of(scan), key=_stamp) + 1
        samples = tuple(self._samples[:upto])
        del self._samples[:upto]
        self._swept_ns = scan.stamp_ns
        if samples:
            self._given_ns = samples[-1].stamp_ns
        return Sweep(scan, samples)


def end_of(scan: LidarScan) -> int:
    """Time of the last point, ns."""
    return scan.stamp_ns + (int(scan.offset_ns.max()) if len(scan.offset_ns) else 0)


def _stamp(message: LidarScan | ImuSample) -> int:
    return message.stamp_ns
