"""sensor_msgs/NavSatFix, with the GGA sentence of the same epoch where there is one, as `GnssFix`."""

from __future__ import annotations

import math
from collections import deque

from drivers.errors import DriverError
from drivers.messages import FixQuality, GnssFix
from drivers.reach.covariance import NO_SIGMA, SOURCE_NONE, SOURCE_TABLE, sigma_from_table
from drivers.reach.sentences import Gga, parse
from edge.replay.store import Raw
from edge.ros.decode import NavSatFix, decode_fix, decode_sentence

_STATUS = {-1: FixQuality.INVALID, 0: FixQuality.SINGLE, 1: FixQuality.DGPS, 2: FixQuality.RTK_FLOAT}
_FIXED_M = 0.05
"""A ground-based fix that claims less is taken as an RTK fix, where no sentence says what it is."""
_SAME_DEG = 2e-9
_REMEMBERED = 16


class FixReader:
    """Sentences first, then the fixes that were made of them, as the receiver's driver emits them."""

    def __init__(self) -> None:
        self._recent: deque[Gga] = deque(maxlen=_REMEMBERED)

    def sentence(self, raw: Raw) -> None:
        """Remember a GGA; everything else means nothing here."""
        text = decode_sentence(raw.data).sentence
        if text[3:6] != "GGA":
            return
        try:
            record = parse(text)
        except DriverError:  # a broken sentence is in the recording for the record only
            return
        if isinstance(record, Gga):
            self._recent.append(record)

    def fix(self, raw: Raw) -> GnssFix:
        """The fix, as good as it can be told."""
        read = decode_fix(raw.data)
        gga = self._same_epoch(read)
        quality = gga.quality if gga is not None else _quality(read)
        hdop = gga.hdop if gga is not None else None
        sigma, source = _sigma(read, quality, hdop)
        separation_m = gga.separation_m if gga is not None else None
        return GnssFix(
            stamp_ns=read.stamp_ns,
            receive_ns=raw.log_ns,
            utc_ns=0,
            date_assumed=True,
            quality=quality,
            latitude_deg=read.latitude_deg,
            longitude_deg=read.longitude_deg,
            height_m=read.altitude_m,
            geoid_separation_m=math.nan if separation_m is None else separation_m,
            satellites=gga.satellites if gga is not None else 0,
            hdop=math.nan if hdop is None else hdop,
            age_s=gga.age_s if gga is not None else None,
            sigma_enu_m=sigma,
            sigma_source=source,
        )

    def _same_epoch(self, read: NavSatFix) -> Gga | None:
        """By position: it is the sentence's own, digit for digit."""
        for gga in reversed(self._recent):
            if gga.position_deg is not None:
                latitude, longitude = gga.position_deg
                if abs(latitude - read.latitude_deg) + abs(longitude - read.longitude_deg) < _SAME_DEG:
                    return gga
        return None


def _quality(read: NavSatFix) -> FixQuality:
    if not math.isfinite(read.latitude_deg + read.longitude_deg):
        return FixQuality.INVALID
    quality = _STATUS.get(read.status, FixQuality.INVALID)
    certain = read.covariance_type != 0 and 0.0 < read.covariance[0] < _FIXED_M**2
    return FixQuality.RTK_FIXED if quality is FixQuality.RTK_FLOAT and certain else quality


def _sigma(read: NavSatFix, quality: FixQuality, hdop: float | None) -> tuple[tuple[float, float, float], str]:
    if quality is FixQuality.INVALID:
        return NO_SIGMA, SOURCE_NONE
    variances = read.covariance[0], read.covariance[4], read.covariance[8]
    if read.covariance_type != 0 and min(variances) > 0.0 and math.isfinite(sum(variances)):
        return (math.sqrt(variances[0]), math.sqrt(variances[1]), math.sqrt(variances[2])), "covariance"
    return sigma_from_table(quality, hdop), SOURCE_TABLE
