"""Rates and gaps against numbers worked out by hand, and against a slow version."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.validation.rates import Span, rates_of

S = 1_000_000_000


def test_a_regular_topic():
    rates = rates_of(np.arange(0, 10 * S + 1, S // 10), Span(-S, 12 * S))
    assert rates.count == 101
    assert rates.rate_hz == pytest.approx(10)
    assert rates.starts_s == 1
    assert rates.ends_before_s == 2
    assert rates.burst_share == 0


def test_the_largest_gap_is_placed():
    rates = rates_of(np.array([0, 1, 2, 5, 6]) * S, Span(0, 6 * S))
    assert (rates.largest_gap_s, rates.gap_at_s) == (3, 2)
    assert rates.gaps(2.0) == 1
    assert rates.missing_s(2.0) == 2


def test_bursts_are_seen():
    times = (np.arange(100)[:, None] * S + np.array([0, 1_000_000, 2_000_000])).ravel()
    assert rates_of(times, Span(0, 100 * S)).burst_share > 0.6


@given(st.lists(st.integers(0, 10**15), min_size=1, max_size=30))
def test_against_a_slow_version(times):
    rates = rates_of(np.array(times, dtype=np.int64), Span(min(times), max(times)))
    ordered = sorted(times)
    intervals = [b - a for a, b in itertools.pairwise(ordered)]
    assert rates.largest_gap_s == max(intervals, default=0) / 1e9
    assert rates.backwards == sum(b < a for a, b in itertools.pairwise(times))
    assert rates.starts_s == 0
    assert rates.ends_before_s == 0
    if intervals:
        at = intervals.index(max(intervals))
        assert rates.gap_at_s == (ordered[at] - ordered[0]) / 1e9
