from datetime import datetime, timezone
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.messages import FixQuality
from drivers.reach.epoch import EpochBuilder
from drivers.reach.sentences import parse
from tests.drivers.reach.nmea_oracle import sentence

HOST_UTC = datetime(2026, 5, 4, 12, 0, tzinfo=timezone.utc)
PERIOD_NS = 200_000_000


def gga(clock, quality=4, lat="5330.0158984"):
    return f"GNGGA,{clock},{lat},N,00216.5258340,W,{quality},12,0.8,52.140,M,51.454,M,1.0,"


def rmc(clock, date="300823", status="A"):
    return f"GNRMC,{clock},{status},5330.0158984,N,00216.5258340,W,0.31,271.54,{date},,,D"


def gst(clock, sigma="0.010"):
    return f"GNGST,{clock},1.000,,,,{sigma},0.020,0.030"


class Feed:
    """Feeds bodies to a builder, each at its own host time, and keeps the epochs."""

    def __init__(self, host_utc=HOST_UTC, period_ms=200):
        self.builder = EpochBuilder(period_ms, lambda: int(host_utc.timestamp()) * 10**9)
        self.epochs = []
        self.now_ns = 10**12

    def burst(self, *bodies, after_ns=PERIOD_NS):
        self.now_ns += after_ns
        for k, body in enumerate(bodies):
            self.keep(self.builder.add(parse(sentence(body)), self.now_ns + k * 5_000_000))

    def keep(self, epoch):
        if epoch is not None:
            self.epochs.append(epoch)

    def end(self):
        self.keep(self.builder.flush())
        return self.epochs


def utc(epoch):
    return datetime.fromtimestamp(epoch.instant.utc_ns / 1e9, timezone.utc).replace(tzinfo=None)


def test_an_epoch_is_gathered_in_any_order_and_closes_when_the_time_changes():
    feed = Feed()
    feed.burst(rmc("231938.60"), gga("231938.60"), gst("231938.60"))
    feed.burst(gga("231938.80"), gst("231938.80"), rmc("231938.80"))
    assert len(feed.epochs) == 1
    first, second = feed.end()
    assert utc(first) == datetime(2023, 8, 30, 23, 19, 38, 600_000)
    assert second.instant.utc_ns - first.instant.utc_ns == 200_000_000
    assert second.receive_ns - first.receive_ns == 200_000_000
    assert (first.gst.north_m, first.gst_age_ms, first.date_assumed) == (0.010, 0, False)
    assert second.rmc.speed_m_s == pytest.approx(0.31 * 1852 / 3600)
    assert feed.builder.counts.missing == 0


def test_an_epoch_closes_after_a_silence():
    feed = Feed()
    feed.burst(gga("231938.60"))
    assert feed.builder.expire(feed.now_ns + 150_000_000) is None
    feed.builder.heard(feed.now_ns + 100_000_000)
    assert feed.builder.expire(feed.now_ns + 170_000_000) is None
    assert feed.builder.expire(feed.now_ns + 261_000_000) is not None
    assert feed.builder.expire(feed.now_ns + 400_000_000) is None


def test_gst_at_1_hz_is_carried_with_its_age_until_the_quality_changes():
    feed = Feed()
    feed.burst(rmc("231938.00"), gga("231938.00"), gst("231938.00"))
    feed.burst(gga("231938.20"))
    feed.burst(gga("231938.40", quality=5))
    feed.burst(gga("231938.60"))
    feed.burst(gga("231941.00"), after_ns=2_400_000_000)
    assert [(e.gst is not None, e.gst_age_ms) for e in feed.end()] == [
        (True, 0),
        (True, 200),
        (False, 0),
        (True, 600),
        (False, 0),
    ]


def test_a_late_gst_serves_the_next_epoch():
    feed = Feed()
    feed.burst(rmc("231938.00"), gga("231938.00"))
    feed.keep(feed.builder.expire(feed.now_ns + PERIOD_NS))
    feed.burst(gst("231938.00"), gga("231938.20"))
    assert [e.gst_age_ms for e in feed.end()] == [0, 200]
    assert feed.epochs[1].gst is not None


def test_before_a_date_the_hosts_is_assumed_within_twelve_hours():
    host_utc = datetime(2026, 5, 4, 0, 0, 10, tzinfo=timezone.utc)
    feed = Feed(host_utc=host_utc)
    feed.burst(gga("235959.80"))
    feed.burst(gga("000000.00"))
    before, after = feed.end()
    assert before.date_assumed
    assert utc(before) == datetime(2026, 5, 3, 23, 59, 59, 800_000)
    assert utc(after) == datetime(2026, 5, 4)


def test_the_date_changes_at_midnight_before_any_sentence_says_so():
    feed = Feed()
    feed.burst(rmc("235959.80", "311223"), gga("235959.80"))
    feed.burst(gga("000000.00"))
    feed.burst(gga("000000.20"), rmc("000000.20", "010124"))
    epochs = feed.end()
    assert utc(epochs[1]) == datetime(2024, 1, 1)
    assert utc(epochs[2]) == datetime(2024, 1, 1, 0, 0, 0, 200_000)
    assert not any(e.date_assumed for e in epochs)
    assert feed.builder.counts.missing == feed.builder.counts.backwards == feed.builder.counts.date_conflicts == 0


def test_a_date_that_lags_at_midnight_is_not_believed_at_once():
    feed = Feed()
    feed.burst(rmc("235959.80", "311223"), gga("235959.80"))
    feed.burst(rmc("000000.00", "311223"), gga("000000.00"))
    feed.burst(rmc("000000.20", "010124"), gga("000000.20"))
    assert [utc(e).day for e in feed.end()] == [31, 1, 1]
    assert feed.builder.counts.date_conflicts == 1


def test_a_date_that_stays_another_is_believed():
    feed = Feed()
    feed.burst(rmc("120000.00", "010124"), gga("120000.00"))
    for tenths in (2, 4, 6, 8):
        feed.burst(rmc(f"120000.{tenths}0", "020124"), gga(f"120000.{tenths}0"))
    assert [utc(e).day for e in feed.end()] == [1, 1, 1, 2, 2]


def test_the_date_of_a_receiver_without_fix_is_not_trusted():
    feed = Feed()
    feed.burst(
        rmc("120000.00", "010120", status="V"), "GNGGA,120000.00,,,,,0,00,,,M,,M,,", "GNZDA,120000.00,01,01,2020,,"
    )
    (epoch,) = feed.end()
    assert epoch.date_assumed
    assert utc(epoch).year == 2026


def test_a_leap_second_is_an_epoch_of_its_own_and_no_gap():
    feed = Feed()
    feed.burst(rmc("235959.80", "311216"), gga("235959.80"))
    for tenths in (0, 2, 4, 6, 8):
        feed.burst(rmc(f"235960.{tenths}0", "311216"), gga(f"235960.{tenths}0"))
    feed.burst(rmc("000000.00", "010117"), gga("000000.00"))
    epochs = feed.end()
    assert len(epochs) == 7
    assert [e.instant.leap_second for e in epochs] == [False] + [True] * 5 + [False]
    assert utc(epochs[1]) == utc(epochs[6]) == datetime(2017, 1, 1)
    assert feed.builder.counts.missing == feed.builder.counts.backwards == feed.builder.counts.date_conflicts == 0


def test_a_gga_without_time_is_an_epoch_without_fix():
    feed = Feed()
    feed.burst("GPRMC,,,,,,,,,,,,", "GPGGA,,,,,,,,,,,,,,", "GNGST,,,,,,,,", "GNZDA,,,,,,")
    feed.burst("GPRMC,,,,,,,,,,,,", "GPGGA,,,,,,,,,,,,,,", "GNGST,,,,,,,,", "GNZDA,,,,,,")
    feed.burst(rmc("120000.00"), gga("120000.00"))
    epochs = feed.end()
    assert [e.instant is None for e in epochs] == [True, True, False]
    assert epochs[0].gga.quality is FixQuality.INVALID
    assert epochs[1].receive_ns - epochs[0].receive_ns == PERIOD_NS


def test_repeated_and_disordered_epochs_are_counted_and_left_out():
    feed = Feed()
    feed.burst(rmc("120000.00"), gga("120000.00"), gga("120000.00", quality=5))
    feed.burst(gga("120000.20"))
    feed.burst(gga("120000.20"))
    feed.burst(gga("115959.80"))
    feed.burst(gga("120000.40"))
    assert [e.instant.utc_ns // 10**8 % 10 for e in feed.end()] == [0, 2, 4]
    assert feed.epochs[0].gga.quality is FixQuality.RTK_FIXED
    assert feed.builder.counts.duplicates == 2
    assert feed.builder.counts.backwards == 1


def test_missing_epochs_are_counted_by_the_streams_own_rhythm():
    feed = Feed(period_ms=200)
    for second in (0, 1, 2, 5, 6):
        gap_ns = 3 * 10**9 if second == 5 else 10**9
        feed.burst(rmc(f"12000{second}"), gga(f"12000{second}"), after_ns=gap_ns)
    assert len(feed.end()) == 5
    # 4 before it was known that this receiver is set to 1 Hz and not to 5.
    assert feed.builder.counts.missing == 4 + 2


def test_time_that_goes_back_for_good_is_followed():
    feed = Feed()
    feed.burst(rmc("120010.00"), gga("120010.00"))
    for k in range(10):
        feed.burst(rmc(f"120007.{k}0"), gga(f"120007.{k}0"), after_ns=100_000_000)
    epochs = feed.end()
    assert feed.builder.counts.steps == 1
    assert feed.builder.counts.missing == 0
    assert [utc(e).second for e in epochs] == [10] + [7] * 8


def test_a_burst_without_gga_is_counted_and_its_date_learnt_later():
    feed = Feed()
    feed.burst(rmc("120000.00"), gst("120000.00"))
    feed.burst(rmc("120000.20"), gga("120000.20"))
    assert len(feed.end()) == 1
    assert feed.builder.counts.without_position == 1


@given(
    st.lists(st.tuples(st.sampled_from([gga, rmc, gst]), st.integers(0, 86399), st.integers(0, 10**10)), max_size=40)
)
def test_any_order_of_times_gives_rising_epochs_between_steps(calls):
    feed = Feed()
    for make, second, after_ns in calls:
        clock = f"{second // 3600:02d}{second // 60 % 60:02d}{second % 60:02d}"
        feed.burst(make(clock), after_ns=after_ns)
    epochs = feed.end()
    assert all(a.receive_ns <= b.receive_ns for a, b in pairwise(epochs))
    assert len(epochs) <= sum(make is gga for make, _, _ in calls)
