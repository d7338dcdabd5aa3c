import math

import pytest

from drivers.messages import FixQuality
from drivers.reach.covariance import sigma_from_gst, sigma_from_table
from drivers.reach.sentences import Gst, parse
from tests.drivers.reach import nmea_oracle


def test_gst_is_north_east_up_and_a_fix_is_east_north_up():
    assert sigma_from_gst(Gst(0, 1.0, None, north_m=4.7, east_m=6.4, up_m=5.9)) == (6.4, 4.7, 5.9)


def test_the_ellipse_serves_where_only_it_is_given():
    east, north, up = sigma_from_gst(Gst(0, 1.0, (3.0, 1.0, 90.0), None, None, 2.0))
    assert (east, north, up) == pytest.approx((3.0, 1.0, 2.0))


@pytest.mark.parametrize("sigma", [0.0, -1.0, None])
def test_certainty_and_emptiness_are_not_believed(sigma):
    assert sigma_from_gst(Gst(0, 1.0, None, sigma, 1.0, 1.0)) is None


def test_the_table_grows_with_hdop():
    assert sigma_from_table(FixQuality.RTK_FIXED, 2.0) == (0.04, 0.04, 0.08)
    assert sigma_from_table(FixQuality.SINGLE, None) == (4.0, 4.0, 8.0)
    assert sigma_from_table(FixQuality.RTK_FIXED, 0.5)[0] == 0.02


def test_the_ellipse_of_real_receivers_agrees_with_their_sigmas():
    """Oracle: the receivers themselves state both."""
    checked = 0
    for name in ("quectel-L70.log", "ublox-zed-f9p-nmea.log"):
        path = nmea_oracle.LOGS / name
        if not path.exists():
            pytest.skip(f"{name} is not here")
        for sentence in nmea_oracle.valid_sentences(path.read_bytes()):
            gst = parse(sentence) if sentence[3:6] == "GST" else None
            if isinstance(gst, Gst) and gst.ellipse and gst.east_m and gst.north_m and gst.up_m:
                projected = sigma_from_gst(Gst(0, None, gst.ellipse, None, None, gst.up_m))
                assert projected is not None
                assert math.isclose(projected[0], gst.east_m, rel_tol=0.05, abs_tol=0.15)
                assert math.isclose(projected[1], gst.north_m, rel_tol=0.05, abs_tol=0.15)
                checked += 1
    assert checked > 5
