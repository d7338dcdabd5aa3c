"""Sigmas of a fix: from GST where the receiver sends it, otherwise from a stated table times HDOP."""

from __future__ import annotations

import math

from drivers.messages import FixQuality
from drivers.reach.sentences import Gst

TABLE_M: dict[FixQuality, float] = {
    FixQuality.SINGLE: 4.0,
    FixQuality.DGPS: 0.1,
    FixQuality.PPP: 0.1,
    FixQuality.RTK_FIXED: 0.02,
    FixQuality.RTK_FLOAT: 4.0,
}
"""Horizontal one-sigma per unit of HDOP: the defaults of ros-drivers/nmea_navsat_driver; PPP taken like DGPS."""
UNKNOWN_M = 100.0
"""Dead reckoning, manual and simulated positions say nothing of their error."""
VERTICAL_RATIO = 2.0
"""Vertical to horizontal sigma in the table: satellites are above only."""
NO_SIGMA = (math.nan, math.nan, math.nan)

SOURCE_GST = "gst"
SOURCE_CARRIED = "gst carried"
"""GST of an earlier epoch of the same quality: receivers send it at 1 Hz by default, positions at 5 Hz."""
SOURCE_TABLE = "quality table x hdop"
SOURCE_NONE = "none"


def sigma_from_gst(gst: Gst) -> tuple[float, float, float] | None:
    """East, north, up in metres; from the ellipse where only that is given; None where it says nothing usable."""
    east, north = gst.east_m, gst.north_m
    if (east is None or north is None) and gst.ellipse is not None:
        east, north = _project(*gst.ellipse)
    if east is None or north is None or gst.up_m is None:
        return None
    # Zero or negative would be certainty, which no receiver has.
    return (east, north, gst.up_m) if min(east, north, gst.up_m) > 0.0 else None


def sigma_from_table(quality: FixQuality, hdop: float | None) -> tuple[float, float, float]:
    """East, north, up in metres for a fix without GST. An HDOP below 1 is taken as 1."""
    horizontal = TABLE_M.get(quality, UNKNOWN_M) * max(hdop or 1.0, 1.0)
    return horizontal, horizontal, VERTICAL_RATIO * horizontal


def _project(major_m: float, minor_m: float, orientation_deg: float) -> tuple[float, float]:
    """East and north sigma of an error ellipse."""
    sine, cosine = math.sin(math.radians(orientation_deg)), math.cos(math.radians(orientation_deg))
    return math.hypot(major_m * sine, minor_m * cosine), math.hypot(major_m * cosine, minor_m * sine)
