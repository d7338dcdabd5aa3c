"""Local east, north, up to WGS 84 and back, by way of Earth-centred coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass

Vector = tuple[float, float, float]

SEMI_MAJOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
_E2 = FLATTENING * (2.0 - FLATTENING)


@dataclass(frozen=True, slots=True)
class Datum:
    """Where the local frame touches the Earth: WGS 84, height above the ellipsoid."""

    latitude_deg: float = 49.0136
    longitude_deg: float = 8.4044
    height_m: float = 165.0
    geoid_separation_m: float = 48.1

    def geodetic(self, enu_m: Vector) -> Vector:
        """Latitude and longitude in degrees and ellipsoidal height of a local point."""
        origin = ecef(self.latitude_deg, self.longitude_deg, self.height_m)
        sin_lat, cos_lat, sin_lon, cos_lon = self._angles()
        east, north, up = enu_m
        radial = cos_lat * up - sin_lat * north
        return geodetic(
            (
                origin[0] + cos_lon * radial - sin_lon * east,
                origin[1] + sin_lon * radial + cos_lon * east,
                origin[2] + cos_lat * north + sin_lat * up,
            )
        )

    def enu(self, latitude_deg: float, longitude_deg: float, height_m: float) -> Vector:
        """Local east, north, up in metres of a point on the Earth."""
        origin = ecef(self.latitude_deg, self.longitude_deg, self.height_m)
        point = ecef(latitude_deg, longitude_deg, height_m)
        x, y, z = (a - b for a, b in zip(point, origin, strict=True))
        sin_lat, cos_lat, sin_lon, cos_lon = self._angles()
        radial = cos_lon * x + sin_lon * y
        return -sin_lon * x + cos_lon * y, cos_lat * z - sin_lat * radial, cos_lat * radial + sin_lat * z

    def _angles(self) -> tuple[float, float, float, float]:
        latitude, longitude = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        return math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)


def ecef(latitude_deg: float, longitude_deg: float, height_m: float) -> Vector:
    """Earth-centred x, y, z in metres."""
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    normal_m = SEMI_MAJOR_M / math.sqrt(1.0 - _E2 * math.sin(latitude) ** 2)
    radial_m = (normal_m + height_m) * math.cos(latitude)
    return (
        radial_m * math.cos(longitude),
        radial_m * math.sin(longitude),
        (normal_m * (1.0 - _E2) + height_m) * math.sin(latitude),
    )


def geodetic(ecef_m: Vector) -> Vector:
    """Latitude and longitude in degrees, ellipsoidal height; Bowring's iteration, exact to nanometres near ground."""
    x, y, z = ecef_m
    radial_m = math.hypot(x, y)
    reduced = math.atan2(z, (1.0 - FLATTENING) * radial_m)
    for _ in range(3):
        latitude = math.atan2(
            z + _E2 / (1.0 - FLATTENING) * SEMI_MAJOR_M * math.sin(reduced) ** 3,
            radial_m - _E2 * SEMI_MAJOR_M * math.cos(reduced) ** 3,
        )
        reduced = math.atan2((1.0 - FLATTENING) * math.sin(latitude), math.cos(latitude))
    curvature_m = SEMI_MAJOR_M * math.sqrt(1.0 - _E2 * math.sin(latitude) ** 2)
    height_m = radial_m * math.cos(latitude) + z * math.sin(latitude) - curvature_m
    return math.degrees(latitude), math.degrees(math.atan2(y, x)), height_m
