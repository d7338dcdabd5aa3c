"""From `map` (ENU at the datum) to the Earth: geodetic, and the site's UTM zone. Heights are above the ellipsoid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pyproj

Array = npt.NDArray[np.float64]
_STEP_M = 10.0


@dataclass(frozen=True)
class Site:
    """datum: latitude, longitude (degrees, WGS 84) and ellipsoidal height (m) of the origin of `map`."""

    datum: tuple[float, float, float]

    @cached_property
    def epsg(self) -> int:
        """WGS 84 / UTM of the datum's zone; the exceptions of Norway and Svalbard are left aside."""
        latitude, longitude, _ = self.datum
        zone = int((longitude + 180.0) // 6.0) % 60 + 1
        return (32600 if latitude >= 0.0 else 32700) + zone

    @cached_property
    def crs(self) -> pyproj.CRS:
        """Of `utm`."""
        return pyproj.CRS.from_epsg(self.epsg)

    @cached_property
    def convergence_deg(self) -> float:
        """Bearing of grid north at the datum, clockwise from true north: `map` has true north, UTM grid north."""
        return self._convergence_and_scale[0]

    @cached_property
    def scale(self) -> float:
        """Metres of the UTM grid at the datum for one on the ellipsoid."""
        return self._convergence_and_scale[1]

    def geodetic(self, enu_m: Array) -> Array:
        """(n, 3) in `map` -> (n, 3) longitude, latitude (degrees), height (m)."""
        return np.column_stack(self._to_geodetic.transform(enu_m[:, 0], enu_m[:, 1], enu_m[:, 2]))

    def utm(self, enu_m: Array) -> Array:
        """(n, 3) in `map` -> (n, 3) easting, northing, height (m)."""
        geodetic = self.geodetic(enu_m)
        east, north = self._to_utm.transform(geodetic[:, 0], geodetic[:, 1])
        return np.column_stack([east, north, geodetic[:, 2]])

    def utm_nearby(self, enu_m: Array) -> Array:
        """As `utm` for points within some hundred metres of each other, by the affine map at their middle.

        Curvature within 100 m is below 1 mm; a projection of each point takes twenty times as long.
        """
        if not len(enu_m):
            return np.empty((0, 3))
        middle = (enu_m.min(axis=0) + enu_m.max(axis=0)) / 2.0
        ends = np.vstack([middle + _STEP_M * np.eye(3), middle - _STEP_M * np.eye(3)])
        there = self.utm(ends)
        slopes = (there[:3] - there[3:]) / (2.0 * _STEP_M)
        return np.asarray(self.utm(middle[None]) + (enu_m - middle) @ slopes)

    def from_geodetic(self, longitude_deg: Array, latitude_deg: Array) -> Array:
        """(n, 2) east and north in `map` of places (n,) at the datum's height."""
        height = np.full(len(longitude_deg), self.datum[2])
        east, north, _ = self._to_geodetic.transform(longitude_deg, latitude_deg, height, direction="INVERSE")
        return np.column_stack([east, north])

    def from_utm(self, utm_m: Array) -> Array:
        """(n, 2) easting, northing -> (n, 2) east and north in `map`, at the datum's height."""
        longitude, latitude = self._to_utm.transform(utm_m[:, 0], utm_m[:, 1], direction="INVERSE")
        return self.from_geodetic(np.asarray(longitude), np.asarray(latitude))

    @cached_property
    def _convergence_and_scale(self) -> tuple[float, float]:
        latitude, longitude, _ = self.datum
        factors = pyproj.Proj(self.crs).get_factors(longitude, latitude)
        return float(factors.meridian_convergence), float(factors.meridional_scale)

    @cached_property
    def _to_geodetic(self) -> pyproj.Transformer:
        latitude, longitude, height = self.datum
        return pyproj.Transformer.from_pipeline(
            "+proj=pipeline "
            f"+step +inv +proj=topocentric +ellps=WGS84 +lon_0={longitude!r} +lat_0={latitude!r} +h_0={height!r} "
            "+step +inv +proj=cart +ellps=WGS84 +step +proj=unitconvert +xy_in=rad +xy_out=deg"
        )

    @cached_property
    def _to_utm(self) -> pyproj.Transformer:
        return pyproj.Transformer.from_crs(4326, self.epsg, always_xy=True)
