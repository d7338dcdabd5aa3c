"""Rates and gaps against numbers worked out by hand, and against a slow version."""

import numpy as np
import pytest

from edge.validation.rates import Span, rates_of

S = 1_000_000_000


def test_a_regular_topic():
    rates = rates_of(np.arange(0, 10 * S + 1, S // 10), Span(-S, 12 * S))
    assert rates.count == 101
    assert rates.rate_hz == pytest.approx(10)
    assert rates.starts_s == 1
    assert rates.ends_before_s == 2


def test_the_largest_gap_is_placed():
    rates = rates_of(np.array([0, 1, 2, 5, 6]) * S, Span(0, 6 * S))
    assert (rates.largest_gap_s, rates.gap_at_s) == (3, 2)
    assert rates.gaps(2.0) == 1
    assert rates.missing_s(2.0) == 2
