import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.gnss_geodesy import Datum as SimulatedDatum
from pipeline.gnss.geodesy import Datum, ecef, geodetic

PLACES = st.tuples(st.floats(-89.9, 89.9), st.floats(-179.9, 179.9), st.floats(-400.0, 9000.0))


@given(PLACES)
def test_geodetic_and_earth_centred_coordinates_are_inverse(place):
    assert geodetic(ecef(*place)) == pytest.approx(place, abs=1e-8)


@given(PLACES, st.tuples(*[st.floats(-30_000.0, 30_000.0)] * 3))
def test_a_point_in_the_map_goes_to_the_earth_and_back(place, point):
    datum = Datum(*place)
    assert datum.enu(*datum.geodetic(np.array(point))) == pytest.approx(point, abs=1e-6)


def test_earth_centred_coordinates_of_known_points():
    assert ecef(0.0, 0.0, 0.0) == pytest.approx((6378137.0, 0.0, 0.0))
    assert ecef(90.0, 0.0, 0.0) == pytest.approx((0.0, 0.0, 6356752.314245), abs=1e-6)
    assert ecef(0.0, 90.0, 100.0) == pytest.approx((0.0, 6378237.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("latitude", [-60.0, 0.0, 40.0573])
def test_a_metre_is_a_metre(latitude):
    """Oracle: the radii of curvature in the meridian and in the prime vertical, in closed form."""
    e2 = 0.0066943799901413165
    w = math.sqrt(1 - e2 * math.sin(math.radians(latitude)) ** 2)
    meridian, normal = 6378137.0 * (1 - e2) / w**3, 6378137.0 / w
    north = math.degrees(1.0 / (meridian + 100.0))
    east = math.degrees(1.0 / ((normal + 100.0) * math.cos(math.radians(latitude))))
    enu = Datum(latitude, 10.0, 100.0).enu(latitude + north, 10.0 + east, 101.0)
    assert enu == pytest.approx((1.0, 1.0, 1.0), abs=1e-6)


def test_the_simulator_places_points_likewise():
    simulated, ours = SimulatedDatum(), Datum(49.0136, 8.4044, 165.0)
    point = (812.0, -455.0, 31.0)
    assert simulated.geodetic(point) == pytest.approx(ours.geodetic(np.array(point)), abs=1e-12)
