"""The map that stamps are taken from: continuous, piecewise linear, and never changed where it was used."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from drivers.clock_filter import OffsetFilter

PIECE_NS = 100_000_000
SETTLE_NS = 5e9
"""Sensor time in which the map slews to the filter's estimate."""
MAX_SLEW = 0.01
"""A first arrival 50 ms late is worked off in 5 s; in steady state the slew is far below 1e-4."""
KEPT_PIECES = 64
FAR_NS = 60_000_000_000
"""After a silence this long the gap is one piece."""


@dataclass(frozen=True, slots=True)
class _Piece:
    sensor_ns: int
    offset_ns: int
    slope: float
    """Change of the offset per nanosecond of sensor time."""

    def offset_at(self, sensor_ns: int) -> int:
        return self.offset_ns + round(self.slope * (sensor_ns - self.sensor_ns))


class ClockMap:
    """host = sensor + offset(sensor), the offset following an `OffsetFilter` without jumps."""

    def __init__(self, sensor_ns: int, offset_ns: int) -> None:
        self._pieces: deque[_Piece] = deque([_Piece(sensor_ns, offset_ns, 0.0)], maxlen=KEPT_PIECES)
        self._end_ns = sensor_ns + PIECE_NS

    def to_host_ns(self, sensor_ns: int, target: OffsetFilter) -> int:
        """Host time of a stamp; lays new pieces towards `target` when the stamp is past the last one."""
        while sensor_ns >= self._end_ns:
            self._extend(sensor_ns, target)
        for piece in reversed(self._pieces):
            if sensor_ns >= piece.sensor_ns:
                return sensor_ns + piece.offset_at(sensor_ns)
        return sensor_ns + self._pieces[0].offset_at(sensor_ns)

    def error_ns(self, target: OffsetFilter) -> float:
        """How far the end of the map is from the filter's estimate."""
        return float(self._pieces[-1].offset_at(self._end_ns) - target.offset_ns(self._end_ns))

    def _extend(self, sensor_ns: int, target: OffsetFilter) -> None:
        start_ns = self._end_ns
        offset_ns = self._pieces[-1].offset_at(start_ns)
        behind_ns = target.offset_ns(start_ns) - offset_ns
        slew = max(-MAX_SLEW, min(MAX_SLEW, behind_ns / SETTLE_NS))
        gap_ns = sensor_ns - start_ns
        if gap_ns > FAR_NS:  # one piece straight onto the estimate: nothing was stamped in between
            slew = behind_ns / gap_ns
            self._end_ns = sensor_ns
        else:
            self._end_ns = start_ns + PIECE_NS
        self._pieces.append(_Piece(start_ns, offset_ns, target.skew + slew))
