"""WGS 84 in closed form, double precision: geodetic <-> Earth-centred <-> local east, north, up."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimates import Array

SEMI_MAJOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
_E2 = FLATTENING * (2.0 - FLATTENING)


@dataclass(frozen=True, slots=True)
class Datum:
    """Origin of `map`: east, north and up are straight axes there, so `map` is Cartesian at any distance."""

    latitude_deg: float
    longitude_deg: float
    height_m: float

    @property
    def origin_m(self) -> Array:
        """(3,) of `map` in Earth-centred axes."""
        return ecef(self.latitude_deg, self.longitude_deg, self.height_m)

    @property
    def turn(self) -> Array:
        """(3, 3) from `map` into Earth-centred axes: its columns are east, north and up."""
        latitude, longitude = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        sin_lat, cos_lat, sin_lon, cos_lon = (
            *(math.sin(latitude), math.cos(latitude)),
            *(math.sin(longitude), math.cos(longitude)),
        )
        return np.array(
            [
                [-sin_lon, -sin_lat * cos_lon, cos_lat * cos_lon],
                [cos_lon, -sin_lat * sin_lon, cos_lat * sin_lon],
                [0.0, cos_lat, sin_lat],
            ]
        )

    def enu(self, latitude_deg: float, longitude_deg: float, height_m: float) -> Array:
        """(3,) metres in `map` of a point on the Earth (degrees, metres above the ellipsoid)."""
        return self.turn.T @ (ecef(latitude_deg, longitude_deg, height_m) - self.origin_m)

    def geodetic(self, enu_m: Array) -> tuple[float, float, float]:
        """Latitude, longitude (degrees) and ellipsoidal height (m) of a point (3,) in `map`."""
        return geodetic(self.origin_m + self.turn @ enu_m)


def ecef(latitude_deg: float, longitude_deg: float, height_m: float) -> Array:
    """(3,) Earth-centred metres."""
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    normal_m = SEMI_MAJOR_M / math.sqrt(1.0 - _E2 * math.sin(latitude) ** 2)
    radial_m = (normal_m + height_m) * math.cos(latitude)
    z_m = (normal_m * (1.0 - _E2) + height_m) * math.sin(latitude)
    return np.array([radial_m * math.cos(longitude), radial_m * math.sin(longitude), z_m])


def geodetic(ecef_m: Array) -> tuple[float, float, float]:
    """Inverse of `ecef` by Bowring's iteration, exact to nanometres up to flying heights."""
    x, y, z = (float(value) for value in ecef_m)
    radial_m = math.hypot(x, y)
    latitude = math.atan2(z, (1.0 - _E2) * radial_m)
    for _ in range(3):
        reduced = math.atan2((1.0 - FLATTENING) * math.sin(latitude), math.cos(latitude))
        latitude = math.atan2(
            z + _E2 / (1.0 - FLATTENING) * SEMI_MAJOR_M * math.sin(reduced) ** 3,
            radial_m - _E2 * SEMI_MAJOR_M * math.cos(reduced) ** 3,
        )
    curvature_m = SEMI_MAJOR_M * math.sqrt(1.0 - _E2 * math.sin(latitude) ** 2)
    height_m = radial_m * math.cos(latitude) + z * math.sin(latitude) - curvature_m
    return math.degrees(latitude), math.degrees(math.atan2(y, x)), height_m
