import math

import pynmea2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.gnss_geodesy import Datum
from drivers.sim.reach_emulator_nmea import SentenceSet, angle, sentences
from drivers.sim.sources import GnssEpoch

NAN = math.nan
REAL_UTC_NS = 1_693_437_578_600_000_000
"""2023-08-30 23:19:38.6, the epoch of the reference sheet."""
REAL = GnssEpoch(
    53 + 30.0158984 / 60, -(2 + 16.5258340 / 60), 103.594, 51.454, 1, 6, 6.5, None, (6.4, 4.7, 5.9), 0.1594777, 271.54
)
NO_FIX = GnssEpoch(NAN, NAN, NAN, 51.454, 0, 3, NAN, None, (NAN, NAN, NAN), 0.0, 0.0)


def lines(epoch, utc_ns=REAL_UTC_NS, knows_time=True, **config):
    return [s.decode().removesuffix("\r\n") for s in sentences(epoch, utc_ns, SentenceSet(**config), knows_time)]


def test_a_real_reach_epoch_is_written_byte_for_byte():
    rmc, gga, gst = lines(REAL)
    assert rmc == "$GNRMC,231938.60,A,5330.0158984,N,00216.5258340,W,0.31,271.54,300823,,,A*5F"
    assert gga == "$GNGGA,231938.60,5330.0158984,N,00216.5258340,W,1,06,6.5,52.140,M,51.454,M,0.0,*78"
    assert gst.startswith("$GNGST,231938.60,") and gst.split("*")[0].endswith(",,,,4.700,6.400,5.900")  # noqa: PT018


def test_the_whole_second_has_reachs_order():
    burst = lines(REAL, REAL_UTC_NS // 10**9 * 10**9)
    kinds = [line[3:6] for line in burst]
    assert kinds[:2] == ["RMC", "GGA"]
    assert kinds[2:6] == ["GSA"] * 4
    assert [line[1:3] for line in burst[2:6]] == ["GP", "GL", "GA", "GB"]
    assert kinds[-4:] == ["VTG", "GST", "ZDA", "EBP"]
    assert set(kinds[6:-4]) == {"GSV"}
    assert burst[-1] == "$GNEBP,,,,,,M*13"


def test_without_fix_everything_is_empty_or_quality_0():
    second = REAL_UTC_NS // 10**9 * 10**9
    empty = lines(NO_FIX, second, talker="GP")
    assert empty[0].startswith("$GPRMC,,,,,,,,,,,,*")
    assert empty[1].startswith("$GPGGA,,,,,,,,,,,,,,*")
    assert lines(NO_FIX, second)[-2:] == ["$GNZDA,,,,,,*56", "$GNEBP,,,,,,M*13"]
    timed = lines(NO_FIX, second, timed_no_fix=True)
    assert timed[1].startswith("$GNGGA,231938.00,,,,,0,03,")
    assert lines(NO_FIX, second, timed_no_fix=True, knows_time=False) == lines(NO_FIX, second)


@given(
    st.floats(-90, 90),
    st.floats(-180, 180),
    st.integers(0, 2**32),
    st.sampled_from([0, 1, 2, 4, 5]),
    st.integers(0, 40),
)
def test_another_parser_reads_what_was_written(latitude, longitude, tenths, quality, satellites):
    utc_ns = REAL_UTC_NS + tenths * 100_000_000
    epoch = (
        GnssEpoch(latitude, longitude, 50.0, 48.0, quality, satellites, 0.9, 1.5, (0.1, 0.2, 0.3), 1.0, 90.0)
        if quality
        else NO_FIX
    )
    for line in lines(epoch, utc_ns, base=Datum()):
        if line[3:6] == "EBP":
            continue
        message = pynmea2.parse(line, check=True)
        if line[3:6] in ("GGA", "RMC") and quality:
            assert message.latitude == pytest.approx(latitude, abs=1e-9)
            assert message.longitude == pytest.approx(longitude, abs=1e-9)
        if line[3:6] == "GSA":
            assert len(line.split(",")) == 18


def test_minutes_never_reach_60():
    assert angle(48.99999999999, 2) == "4900.0000000"
    assert angle(0.5, 3) == "00030.0000000"
