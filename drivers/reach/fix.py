"""One epoch as the message the appliance records."""

from __future__ import annotations

import math

from drivers.messages import FixQuality, GnssFix
from drivers.reach import covariance
from drivers.reach.epoch import Epoch

CORRECTED = (FixQuality.DGPS, FixQuality.RTK_FIXED, FixQuality.RTK_FLOAT)
"""Qualities whose age of corrections means something: Reach prints 0.0 for the others."""


def fix_of(epoch: Epoch, stamp_ns: int) -> GnssFix:
    """`stamp_ns`: host time of the measurement. UTC is 0 where the receiver did not know the time."""
    gga, rmc = epoch.gga, epoch.rmc
    latitude, longitude = gga.position_deg or (math.nan, math.nan)
    separation_m = math.nan if gga.separation_m is None else gga.separation_m
    has_height = gga.position_deg is not None and gga.altitude_m is not None
    sigma_enu_m, source = _sigma(epoch)
    moving = rmc is not None and rmc.active
    return GnssFix(
        stamp_ns=stamp_ns,
        receive_ns=epoch.receive_ns,
        utc_ns=0 if epoch.instant is None else epoch.instant.utc_ns,
        date_assumed=epoch.date_assumed,
        quality=gga.quality,
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=(gga.altitude_m or 0.0) + separation_m if has_height else math.nan,
        geoid_separation_m=separation_m,
        satellites=gga.satellites,
        hdop=math.nan if gga.hdop is None else gga.hdop,
        age_s=gga.age_s if gga.quality in CORRECTED else None,
        sigma_enu_m=sigma_enu_m,
        sigma_source=source,
        speed_m_s=rmc.speed_m_s if rmc is not None and moving else None,
        course_deg=rmc.course_deg if rmc is not None and moving else None,
    )


def _sigma(epoch: Epoch) -> tuple[tuple[float, float, float], str]:
    if epoch.gga.quality is FixQuality.INVALID:
        return covariance.NO_SIGMA, covariance.SOURCE_NONE
    sigma = None if epoch.gst is None else covariance.sigma_from_gst(epoch.gst)
    if sigma is None:
        return covariance.sigma_from_table(epoch.gga.quality, epoch.gga.hdop), covariance.SOURCE_TABLE
    return sigma, covariance.SOURCE_CARRIED if epoch.gst_age_ms else covariance.SOURCE_GST
