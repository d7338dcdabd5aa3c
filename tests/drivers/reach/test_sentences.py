import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import ProtocolError
from drivers.messages import FixQuality
from drivers.reach.sentences import Ebp, Gga, Gst, Rmc, Zda, parse
from drivers.reach.utc import DAY_MS, midnight_ms, nearest_ms, time_of_day_ms
from tests.drivers.reach import nmea_oracle


def read(body):
    return parse(nmea_oracle.sentence(body))


def test_a_real_reach_epoch():
    gga = read("GNGGA,231938.60,5330.0158984,N,00216.5258340,W,1,06,6.5,52.140,M,51.454,M,0.0,")
    assert isinstance(gga, Gga)
    assert gga.time_ms == 83_978_600
    assert gga.quality is FixQuality.SINGLE
    assert gga.position_deg == pytest.approx((53.50026497333, -2.27543056667), abs=1e-11)
    assert (gga.satellites, gga.hdop, gga.altitude_m, gga.separation_m, gga.age_s) == (6, 6.5, 52.140, 51.454, 0.0)
    rmc = read("GNRMC,231938.60,A,5330.0158984,N,00216.5258340,W,0.31,271.54,300823,,,A")
    assert isinstance(rmc, Rmc)
    assert rmc.active
    assert rmc.date_ms == 1_693_353_600_000  # date -u -d 2023-08-30 +%s
    assert rmc.speed_m_s == pytest.approx(0.1594777)
    assert rmc.course_deg == 271.54
    gst = read("GNGST,231938.60,11.000,,,,4.700,6.400,5.900")
    assert gst == Gst(83_978_600, 11.0, None, 4.7, 6.4, 5.9)
    assert read("GNZDA,231938.60,30,08,2023,00,00") == Zda(83_978_600, 1_693_353_600_000)
    assert read("GNEBP,,,,,,M") == Ebp(None, None)


@pytest.mark.parametrize(
    "body",
    [
        "GPGGA,,,,,,,,,,,,,,",
        "GNGGA,231938.60,0000.0000000,N,00000.0000000,E,0,00,,,M,,M,,",
        "GNGGA,231938.60,0000.0000000,N,00000.0000000,E,1,05,2.0,0.0,M,0.0,M,,",
        "GNGGA,231938.60,,,,,1,05,2.0,,M,,M,,",
        "GNGGA,231938.60,5330.0158984,N,00216.5258340,W,,06,6.5,52.140,M,51.454,M,0.0,",
    ],
)
def test_no_position_is_no_fix_whatever_the_fields_hold(body):
    gga = read(body)
    assert isinstance(gga, Gga)
    assert gga.position_deg is None
    assert gga.quality is FixQuality.INVALID


def test_empty_rmc_and_zda_know_nothing():
    assert read("GPRMC,,,,,,,,,,,,") == Rmc(None, False, None, None, None)
    assert read("GNZDA,,,,,,") == Zda(None, None)


def test_an_nmea_4_1_rmc_is_active():
    rmc = read("GNRMC,231408.00,A,4503.94632,N,00739.54368,E,0.013,,110425,,,F,V")
    assert isinstance(rmc, Rmc)
    assert rmc.active
    assert rmc.course_deg is None


def test_talkers_and_extra_fields_do_not_matter():
    assert read("GPGST,010203,1,,,,0.1,0.2,0.3,9,9") == Gst(3_723_000, 1.0, None, 0.1, 0.2, 0.3)


@pytest.mark.parametrize("body", ["GNGSV,1,1,00", "GNTXT,01,01,02,txbuf alloc", "PTNL,GGK", "X", "GNNOPE,1"])
def test_other_sentences_are_of_no_interest(body):
    assert read(body) is None


@pytest.mark.parametrize(
    "body",
    [
        "GNGGA,251938.60,5330.0,N,00216.5,W,1,06,6.5,52.1,M,51.4,M,0.0,",
        "GNGGA,231938.60,5360.0,N,00216.5,W,1,06,6.5,52.1,M,51.4,M,0.0,",
        "GNGGA,231938.60,9130.0,N,00216.5,W,1,06,6.5,52.1,M,51.4,M,0.0,",
        "GNGGA,231938.60,5330.0,E,00216.5,W,1,06,6.5,52.1,M,51.4,M,0.0,",
        "GNGGA,231938.60,5330.0,N,00216.5,W,x,06,6.5,52.1,M,51.4,M,0.0,",
        "GNGGA,231938.60,5330.0,N,00216.5,W,1,06,nan,52.1,M,51.4,M,0.0,",
        "GNRMC,231938.60,A,5330.0,N,00216.5,W,0.31,271.54,310223,,,A",
        "GNGST,231938.60,1e3,,,,4.7,6.4,5.9",
    ],
)
def test_broken_fields_are_refused(body):
    with pytest.raises(ProtocolError):
        read(body)


@given(st.sampled_from(["GGA", "RMC", "GST", "ZDA", "EBP"]), st.lists(st.text("0123456789.-NSEWAVM x", max_size=12)))
def test_any_fields_are_read_or_refused(kind, fields):
    try:
        record = read(",".join(["GN" + kind, *fields]))
    except ProtocolError:
        return
    assert record is None or type(record).__name__.upper() == kind


@pytest.mark.parametrize(
    ("text", "ms"),
    [("004646", 2_806_000), ("231938.60", 83_978_600), ("000000.000", 0), ("235960.25", DAY_MS + 250), ("", None)],
)
def test_time_of_day(text, ms):
    assert time_of_day_ms(text) == ms


@pytest.mark.parametrize("text", ["240000", "126060", "115960.0", "1234", "12345x", "-10000"])
def test_what_is_no_time_of_day(text):
    with pytest.raises(ProtocolError):
        time_of_day_ms(text)


def test_the_year_a_receiver_starts_with_is_no_date():
    assert midnight_ms("06", "01", "80") is None
    assert midnight_ms("06", "01", "1980") is None


@given(st.integers(0, DAY_MS - 1), st.integers(10**12, 2 * 10**12))
def test_the_date_puts_a_time_within_twelve_hours(time_ms, reference_ms):
    utc_ms = nearest_ms(time_ms, reference_ms)
    assert utc_ms % DAY_MS == time_ms
    assert abs(utc_ms - reference_ms) <= DAY_MS // 2
