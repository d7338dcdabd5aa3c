"""Names of the frames (REP-105) and a transform between two of them."""

from __future__ import annotations

from dataclasses import dataclass

EARTH = "earth"
"""Earth-centred, Earth-fixed WGS 84 (REP-105)."""
MAP = "map"
ODOM = "odom"
BASE_LINK = "base_link"
LIDAR = "livox_frame"
CAMERA = "camera"
GNSS_ANTENNA = "gnss_antenna"


@dataclass(frozen=True, slots=True)
class Transform:
    """Pose of `child` in `parent`: a point p in `child` is at rotation * p + translation in `parent`."""

    parent: str
    child: str
    translation_m: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
