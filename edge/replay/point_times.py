"""What the times of a foreign LiDAR's points mean: which unit, counted from where.

One sweep lasts between a fiftieth of a second and a second. Units are a factor of a thousand apart, so at most one
makes the spread of a sweep's times that long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from edge.errors import FormatError

NAMES = (
    "timestamp",
    "offset_time",
    "t",
    "time",
    "time_offset",
    "timeoffset",
    "time_stamp",
    "point_time",
    "ts",
)
"""livox_ros_driver2; its CustomMsg; Ouster; Velodyne; and relatives of these."""
_UNITS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
_SWEEP_S = (0.004, 1.5)
_RELATIVE_S = 2.0
_SAME_CLOCK_S = 10.0


class Origin(Enum):
    """What the times are counted from."""

    STAMP = "the message's stamp"
    CLOCK = "the clock of the message's stamp"
    OTHER = "a clock of their own"


@dataclass(frozen=True, slots=True)
class PointTimes:
    """How to read the field `name` of every cloud of a topic."""

    name: str
    unit_ns: int
    origin: Origin

    def absolute_ns(self, values: npt.NDArray[np.generic], stamp_ns: int) -> npt.NDArray[np.int64]:
        """(n,) int64 times of points in the clock of the stamps. A clock of their own starts with the stamp."""
        if self.origin is Origin.STAMP:
            return stamp_ns + _whole_ns(values, self.unit_ns)
        times = _whole_ns(values, self.unit_ns)
        return times if self.origin is Origin.CLOCK else times - times.min() + stamp_ns

    def __str__(self) -> str:
        unit = next(name for name, ns in _UNITS.items() if ns == self.unit_ns)
        return f"field {self.name!r} in {unit} from {self.origin.value}"


def find_field(names: Sequence[str], topic: str) -> str:
    """The field that holds the points' times. FormatError when there is none."""
    by_lower = {name.lower(): name for name in names}
    for name in NAMES:
        if name in by_lower:
            return by_lower[name]
    raise FormatError(
        f"{topic}: its points have no time of their own (fields {', '.join(names)}; looked for {', '.join(NAMES)}). "
        "Odometry needs the time of each point to take the motion out of a sweep: have the LiDAR's driver publish it "
        "(Livox: xfer_format 0 or 1; Ouster: point_type original; Velodyne: field time), and record again"
    )


def find_times(
    topic: str, name: str, samples: Sequence[npt.NDArray[np.generic]], stamps_ns: Sequence[int]
) -> PointTimes:
    """Unit and origin from the times of some clouds, each (n,), with the stamps of their messages. FormatError."""
    spreads = [float(np.ptp(values.astype(np.float64))) for values in samples if len(values)]
    widest = max(spreads, default=0.0)
    if widest == 0.0:
        raise FormatError(
            f"{topic}: all points of a cloud have the same {name!r}; without the time of each point the motion cannot "
            "be taken out of a sweep. Update the LiDAR's driver (livox_ros_driver2 before 1.2 has this fault)"
        )
    unit_ns = next((ns for ns in _UNITS.values() if _SWEEP_S[0] <= widest * ns / 1e9 <= _SWEEP_S[1]), 0)
    if not unit_ns:
        raise FormatError(
            f"{topic}: the field {name!r} spans {widest:g} within a cloud, which is a sweep of {_SWEEP_S[0]:g} to "
            f"{_SWEEP_S[1]:g} s in none of {', '.join(_UNITS)}; name the right field with --time-field"
        )
    pairs = zip(samples, stamps_ns, strict=True)
    return PointTimes(name, unit_ns, _origin([(_whole_ns(v, unit_ns), stamp) for v, stamp in pairs if len(v)]))


def _origin(clouds: Sequence[tuple[npt.NDArray[np.int64], int]]) -> Origin:
    """By the median over the clouds: one may be torn."""
    first_s = float(np.median([times.min() for times, _ in clouds])) / 1e9
    apart_s = float(np.median([float(times.min() - stamp) for times, stamp in clouds])) / 1e9
    if abs(apart_s) < _SAME_CLOCK_S and abs(first_s) > _RELATIVE_S:
        return Origin.CLOCK
    # A sensor that counts from its start is near zero as well, but only in its first seconds.
    if all(abs(int(times.min())) < _RELATIVE_S * 1e9 for times, _ in clouds):
        return Origin.STAMP
    return Origin.OTHER


def _whole_ns(values: npt.NDArray[np.generic], unit_ns: int) -> npt.NDArray[np.int64]:
    if values.dtype.kind in "iu":
        return np.asarray(values.astype(np.int64) * unit_ns)
    scaled = values.astype(np.float64)
    # Whole seconds apart: 1.7e18 ns has no room for fractions in a double that 1.7e9 s still has.
    whole = np.floor(scaled)
    return np.asarray(whole.astype(np.int64) * unit_ns + np.rint((scaled - whole) * unit_ns).astype(np.int64))
