"""A walk in a circle, its odometry that drifts, and fixes of it."""

from __future__ import annotations

import numpy as np

from drivers.messages import FixQuality, GnssFix
from pipeline.estimates import OdometryEstimate
from pipeline.gnss.geodesy import Datum
from pipeline.products.track import record_of

DATUM = Datum(47.0, 8.0, 500.0)
ARM_M = np.array([-0.05, 0.0, 0.2])
PERIOD_S = 0.5


def turned(yaw):
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def circle(radius_m=25.0, laps=1.0, speed_m_s=1.0):
    """Seconds (n,), positions (n, 3) in `map`, yaw (n,)."""
    seconds = np.arange(0.0, laps * 2.0 * np.pi * radius_m / speed_m_s, PERIOD_S)
    angle = speed_m_s * seconds / radius_m
    positions = radius_m * np.column_stack([np.cos(angle), np.sin(angle), 0.02 * np.sin(angle)])
    return seconds, positions, angle + np.pi / 2.0


def odometry(seconds, positions, yaw, *, drift_m=0.02, drift_yaw_deg=0.02, seed=1):
    """(n,) of ESTIMATE, beginning at the origin with heading 0; says of its own drift what is true."""
    random = np.random.default_rng(seed)
    track, place, turn, covariance, way = [], np.zeros(3), -yaw[0], np.zeros((4, 4)), 0.0
    for k, second in enumerate(seconds):
        if k:
            step = positions[k] - positions[k - 1]
            length = float(np.linalg.norm(step))
            turn += np.radians(drift_yaw_deg) * np.sqrt(length) * random.standard_normal()
            moved = turned(turn) @ step + drift_m * np.sqrt(length) * random.standard_normal(3)
            carry = np.eye(4)
            carry[1, 0], carry[2, 0] = -moved[1], moved[0]
            grown = [np.radians(drift_yaw_deg) ** 2, *[drift_m**2] * 3]
            covariance = carry @ covariance @ carry.T + length * np.diag(grown)
            place, way = place + moved, way + length
        full = np.diag([0.0] * 3 + [1e-6] * 3)
        full[:3, :3], full[5, 5] = covariance[1:, 1:], covariance[0, 0] + 1e-6
        full[:3, 5] = full[5, :3] = covariance[0, 1:]
        zero = np.zeros(3)
        pose = (place.copy(), turned(turn + yaw[k]), zero, full, zero, zero)
        track.append(record_of(OdometryEstimate(round(second * 1e9), *pose, way, False, np.zeros((0, 3)), 9, 9)))
    return np.concatenate(track)


def fixes(seconds, positions, yaw, *, sigma_m=0.3, every=2, off=None, seed=2):
    """Every so many poses one, with white errors; off: (from_s, to_s, (3,)) an error that no sigma tells of."""
    random = np.random.default_rng(seed)
    heard = []
    for k in range(0, len(seconds), every):
        error = sigma_m * random.standard_normal(3)
        if off is not None and off[0] <= seconds[k] <= off[1]:
            error = error + off[2]
        place = DATUM.geodetic(positions[k] + turned(yaw[k]) @ ARM_M + error)
        stamp = round(seconds[k] * 1e9)
        quality = (12, 0.8, 1.0, (sigma_m, sigma_m, sigma_m), "gst")
        heard.append(GnssFix(stamp, stamp, 0, False, FixQuality.RTK_FLOAT, *place, 0.0, *quality))
    return heard
