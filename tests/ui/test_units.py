"""Quantities in words."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ui import units


@pytest.mark.parametrize(
    ("seconds", "shown"), [(0, "0:00:00"), (59.9, "0:00:59"), (754, "0:12:34"), (36_000, "10:00:00"), (-1, "0:00:00")]
)
def test_elapsed_reads_like_a_stop_watch(seconds, shown):
    assert units.elapsed(seconds) == shown


@pytest.mark.parametrize(
    ("seconds", "shown"),
    [(None, "-"), (45, "45s"), (60, "1m"), (3599, "59m"), (7920, "2h 12m"), (359_999, "99h 59m"), (1e9, "> 99h")],
)
def test_time_left_is_coarse(seconds, shown):
    assert units.remaining(seconds) == shown


@pytest.mark.parametrize(
    ("count", "shown"),
    [
        (0, "0 B"),
        (999, "999 B"),
        (1000, "1.00 kB"),
        (9_996_000, "10.0 MB"),
        (2_860_000_000, "2.86 GB"),
        (10**15, "1000 TB"),
    ],
)
def test_sizes_have_three_digits(count, shown):
    assert units.size(count) == shown


@given(st.integers(0, 10**15 - 1))
def test_a_size_is_never_off_by_more_than_its_last_digit(count):
    value, unit = units.size(count).split()
    scale = {"B": 1, "kB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12}[unit]
    assert float(value) * scale == pytest.approx(count, rel=0.0051, abs=0.5)
    assert len(units.size(count)) <= 7


@given(st.integers(0, 10**9 - 1))
def test_a_counter_fits_its_column(number):
    assert len(units.count(number)) <= 5


@given(st.floats(0, 1e6))
def test_durations_fit_their_columns(seconds):
    assert len(units.remaining(seconds)) <= 8
    assert len(units.age(seconds)) <= 7


@pytest.mark.parametrize(
    ("sigma", "shown"), [(0.021, "0.02 m"), (1.44, "1.4 m"), (9.97, "10 m"), (math.nan, "-"), (math.inf, "-")]
)
def test_metres_have_two_digits_and_say_when_unknown(sigma, shown):
    assert units.metres(sigma) == shown


@pytest.mark.parametrize(
    ("sigma", "shown"), [(0.31, "0.31ms"), (2.13, "2.1ms"), (48.4, "48ms"), (1240, "1.2s"), (math.nan, "-"), (1e9, "-")]
)
def test_clock_sigmas_are_in_milliseconds(sigma, shown):
    assert units.millis(sigma) == shown


def test_rates_are_short():
    assert [units.hertz(rate) for rate in (0, 9.96, 99.96, 200.1)] == ["0.0", "10.0", "100", "200"]
    assert [units.nominal_hertz(rate) for rate in (10, 29.97, 200, 0.5)] == ["10", "29.97", "200", "0.5"]


def test_ages_grow_coarser():
    assert [units.age(s) for s in (-1, 0.44, 12, 119, 180, 7300)] == ["0.0 s", "0.4 s", "12 s", "119 s", "3 min", "2 h"]
