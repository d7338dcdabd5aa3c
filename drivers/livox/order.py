"""Inertial samples put back in order: odometry cannot use one whose time goes back."""

from __future__ import annotations

import bisect
from collections.abc import Callable
from typing import NamedTuple

PATIENCE_NS = 20_000_000
"""So long, four samples, one waits for those missing before it. Over a cable nothing overtakes, and nothing waits."""


class Sample(NamedTuple):
    """One sample as it came: device time, reception, and the six values."""

    sensor_ns: int
    receive_ns: int
    values: tuple[float, ...]


class SampleOrder:
    """Passes samples on at once, but for those that overtook another one."""

    def __init__(self, emit: Callable[[Sample], None]) -> None:
        self._emit = emit
        self._held: list[Sample] = []
        self._missing = 0
        self._wait_ns = 0
        self._passed_ns = -1
        self._received_ns = 0

    def take(self, sample: Sample, missing: int) -> bool:
        """A sample, and by how many more (or fewer) its stream lacks now. False when it came too late to be used."""
        if sample.sensor_ns <= self._passed_ns:
            return False
        bisect.insort(self._held, sample)
        self._missing += missing
        newest_ns = self._held[-1].sensor_ns
        if missing > 0:
            self._wait_ns = newest_ns + PATIENCE_NS
        if self._missing <= 0 or newest_ns >= self._wait_ns:
            self.release()
        else:
            self._pass(bisect.bisect(self._held, newest_ns - PATIENCE_NS, key=_device_time))
        return True

    def release(self) -> None:
        """Wait no longer."""
        self._missing = 0
        self._pass(len(self._held))

    def _pass(self, count: int) -> None:
        passed, self._held = self._held[:count], self._held[count:]
        for sample in passed:
            self._passed_ns = sample.sensor_ns
            # Handed on now, so that the order of reception is that of the file as well.
            self._received_ns = max(self._received_ns, sample.receive_ns)
            self._emit(sample._replace(receive_ns=self._received_ns))

    def restart(self) -> None:
        """The device's time begins anew."""
        self.release()
        self._passed_ns = -1


def _device_time(sample: Sample) -> int:
    return sample.sensor_ns
