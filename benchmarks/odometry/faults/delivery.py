"""What can happen between the sensors and the odometry: silence, lateness, disorder, wrong stamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.odometry.faults.streams import SECOND_NS, Fault, Span, Streams, each_sample, each_scan


def no_scans(streams: Streams, span: Span) -> Streams:
    """The LiDAR's points stop."""
    return replace(streams, scans=tuple(scan for scan in streams.scans if not span.holds(scan)))


def no_samples(streams: Streams, span: Span) -> Streams:
    """The inertial samples stop."""
    return replace(streams, imu=tuple(sample for sample in streams.imu if not span.holds(sample)))


def late_scans(by_s: float, every: int = 1) -> Fault:
    """Each so many scan is delivered that much later."""

    def apply(streams: Streams, span: Span) -> Streams:
        late = [
            replace(scan, receive_ns=scan.receive_ns + int(by_s * SECOND_NS))
            if span.holds(scan) and k % every == 0
            else scan
            for k, scan in enumerate(streams.scans)
        ]
        return replace(streams, scans=tuple(late))

    return apply


def disordered_scans(streams: Streams, span: Span) -> Streams:
    """Every second scan comes after the one after it, and every third one twice."""
    found = []
    for k, scan in enumerate(streams.scans):
        held = span.holds(scan)
        found.append(replace(scan, receive_ns=scan.receive_ns + 110_000_000) if held and k % 2 else scan)
        if held and k % 3 == 0:
            found.append(replace(scan, receive_ns=scan.receive_ns + 30_000_000))
    return replace(streams, scans=tuple(found))


def disordered_samples(streams: Streams, span: Span) -> Streams:
    """Samples overtake each other by up to 20 ms, and a tenth comes twice."""
    random = np.random.default_rng(31)
    found = []
    for sample in streams.imu:
        late = replace(sample, receive_ns=sample.receive_ns + int(random.integers(0, 20_000_000)))
        found.append(late if span.holds(sample) else sample)
        if span.holds(sample) and random.random() < 0.1:
            found.append(replace(sample, receive_ns=sample.receive_ns + 40_000_000))
    return replace(streams, imu=tuple(found))


def leaping_scans(by_s: float) -> Fault:
    """The stamps of the scans leap, and come back after the span."""
    by_ns = int(by_s * SECOND_NS)
    return lambda streams, span: each_scan(streams, span, lambda scan: replace(scan, stamp_ns=scan.stamp_ns + by_ns))


def leaping_samples(by_s: float) -> Fault:
    """The stamps of the inertial samples leap, and come back after the span."""
    by_ns = int(by_s * SECOND_NS)
    return lambda streams, span: each_sample(
        streams, span, lambda sample: replace(sample, stamp_ns=sample.stamp_ns + by_ns)
    )
