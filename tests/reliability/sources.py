"""What the emulated sensors see here: numbers, so that everything recorded can be accounted for one by one."""

from __future__ import annotations

import numpy as np

from drivers.sim.sources import PointBlock
from tests.drivers.sources import DATUM, tiny_units

POINTS = 96
RETURNS = 64
"""Of the 96 points of a packet; the others are no-returns."""
INCARNATION = 1_000_000
"""An emulator that is started again numbers from the next million; float32 is exact up to the sixteenth."""
METRES_AN_EPOCH = 0.2
"""The antenna moves east by so much between two epochs at 5 Hz."""
FILLER = b"\x00\x00\x00\x01\x0c"
"""Start code of a filler NAL unit, in which a frame carries its number."""


class Numbers:
    """Each point packet carries its number in y (mm), each inertial sample in the yaw rate."""

    def __init__(self, incarnation: int) -> None:
        self._packet = self._sample = incarnation * INCARNATION

    def cast(self, t_ns: int, count: int) -> PointBlock:
        number = self._packet + np.arange(count) // POINTS
        self._packet += count // POINTS
        slot = np.arange(count) % POINTS
        xyz = np.stack((slot + 1, number, np.full(count, -300)), axis=1).astype(np.int32)
        xyz[slot % 3 == 0] = 0
        return PointBlock(xyz, np.full(count, 10, np.uint8), np.full(count, 16, np.uint8))

    def sample(self, t_ns: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        self._sample += 1
        return (0.0, 0.0, float(self._sample)), (0.0, 0.0, 1.0)


def eastings_m(longitudes: np.ndarray) -> np.ndarray:
    """Back from the longitudes; within millimetres for a walk of minutes."""
    east = DATUM.geodetic((100.0, 0.0, 0.0))[1] - DATUM.geodetic((0.0, 0.0, 0.0))[1]
    return (longitudes - DATUM.geodetic((0.0, 0.0, 0.0))[1]) / east * 100.0


class NumberedVideo:
    """Small H.264 frames with a keyframe every ten, each with its number at its end."""

    def __init__(self, incarnation: int) -> None:
        self._base = incarnation * INCARNATION

    def access_unit(self, index: int) -> tuple[bytes, bool]:
        units = tiny_units()
        return units[index % len(units)] + FILLER + b"%09d" % (self._base + index) + b"\xff\x80", index % 10 == 0


def frame_number(data: bytes) -> int:
    """The number of a frame that is whole to the last byte; AssertionError otherwise."""
    unit, _, tail = data.rpartition(FILLER)
    assert len(tail) == 11, tail
    assert tail.endswith(b"\xff\x80"), tail
    number = int(tail[:9])
    assert unit == tiny_units()[number % INCARNATION % len(tiny_units())], f"frame {number} is not as it was sent"
    return number


def missing(numbers: np.ndarray) -> int:
    """How many are left out between the first and the last."""
    return int(numbers[-1] - numbers[0] + 1 - len(np.unique(numbers))) if len(numbers) else 0
