"""A walk as the odometry receives it, and the stretch of it in which something is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from drivers.messages import ImuSample, LidarScan
from pipeline.evaluation.trajectory import Trajectory

SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Streams:
    """Messages in the order of their stamps as they truly are; `receive_ns` says when each is delivered.

    truth: of `base_link`; for what happens in the world, and for judging.
    """

    scans: tuple[LidarScan, ...]
    imu: tuple[ImuSample, ...]
    truth: Trajectory

    def delivered(self) -> list[LidarScan | ImuSample]:
        """In order of delivery; samples before the scan of the same instant."""
        messages: list[LidarScan | ImuSample] = [*self.imu, *self.scans]
        return sorted(messages, key=lambda message: message.receive_ns)


@dataclass(frozen=True, slots=True)
class Span:
    """From begin_ns to end_ns, as stamps."""

    begin_ns: int
    end_ns: int

    def holds(self, message: LidarScan | ImuSample) -> bool:
        """Whether a message is of this stretch."""
        return self.begin_ns <= message.stamp_ns < self.end_ns


Fault = Callable[[Streams, Span], Streams]
"""A pure function; what is random in it comes from a fixed seed."""


def each_scan(streams: Streams, span: Span, change: Callable[[LidarScan], LidarScan]) -> Streams:
    """With the scans of the span changed."""
    return replace(streams, scans=tuple(change(scan) if span.holds(scan) else scan for scan in streams.scans))


def each_sample(streams: Streams, span: Span, change: Callable[[ImuSample], ImuSample]) -> Streams:
    """With the inertial samples of the span changed."""
    return replace(streams, imu=tuple(change(sample) if span.holds(sample) else sample for sample in streams.imu))


def chosen(scan: LidarScan, keep: np.ndarray) -> LidarScan:
    """With some of its points only: keep is a mask or an index."""
    return replace(
        scan,
        xyz_m=scan.xyz_m[keep],
        reflectivity=scan.reflectivity[keep],
        tag=scan.tag[keep],
        line=scan.line[keep],
        offset_ns=scan.offset_ns[keep],
    )


def both(*faults: Fault) -> Fault:
    """One after the other."""

    def apply(streams: Streams, span: Span) -> Streams:
        for fault in faults:
            streams = fault(streams, span)
        return streams

    return apply
