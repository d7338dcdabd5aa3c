"""A fix beside what the odometry knew at the same instant."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.messages import FixQuality, GnssFix
from pipeline.estimates import Array
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.geodesy import Datum
from pipeline.gnss.history import History, Passage
from pipeline.gnss.trust import floored_m, usable


@dataclass(frozen=True, slots=True)
class Sighting:
    """A fix in `map` (3,) with its sigmas (3,) before any scale, and where the odometry saw the antenna then."""

    passage: Passage
    position_m: Array
    sigma_m: Array
    quality: FixQuality


def measured_ns(fix: GnssFix, config: FusionConfig) -> int:
    """When the antenna was there."""
    return fix.stamp_ns - round(1e9 * config.stamped_late_s)


class Sightings:
    """Places fixes in the odometry's history. The first one placed is the datum."""

    def __init__(self, history: History, config: FusionConfig) -> None:
        self.datum: Datum | None = None
        self.refused = 0
        """Fixes that claim no position, or whose instant the odometry does not know."""
        self._history = history
        self._config = config
        self._last_ns: int | None = None

    def place(self, fix: GnssFix) -> Sighting | None:
        """None for a fix that is refused, or closer than `spacing_s` to the one before."""
        stamp_ns = measured_ns(fix, self._config)
        if self._last_ns is not None and abs(stamp_ns - self._last_ns) < 1e9 * self._config.spacing_s:
            return None
        passage = self._history.at(stamp_ns) if usable(fix) else None
        if passage is None:
            self.refused += 1
            return None
        self._last_ns = stamp_ns
        place = (fix.latitude_deg, fix.longitude_deg, fix.height_m)
        self.datum = self.datum or Datum(*place)
        return Sighting(passage, self.datum.enu(*place), floored_m(fix, self._config), fix.quality)
