import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.messages import ImuSample
from pipeline.odometry.imu_buffer import HELD_S, ImuBuffer

MS = 1_000_000


def sample(at_ms, value=None):
    value = float(at_ms) if value is None else value
    return ImuSample(at_ms * MS, at_ms * MS, (value, 0.0, 0.0), (0.0, 0.0, 9.8))


def buffer(*at_ms):
    held = ImuBuffer()
    for one in at_ms:
        held.add(sample(one))
    return held


@given(st.permutations(list(range(0, 100, 5))), st.lists(st.sampled_from(range(0, 100, 5)), max_size=5))
def test_however_they_come_in_they_stand_in_order_and_once(order, again):
    held = buffer(*order, *again)
    table = held.window(0, 100 * MS)
    np.testing.assert_allclose(table[:, 0], np.arange(0, 100, 5) * 1e-3)
    np.testing.assert_allclose(table[:, 1], np.arange(0, 100, 5))
    assert held.late == len(again)


def test_a_stretch_begins_and_ends_exactly_with_values_in_between():
    table = buffer(0, 5, 10, 15).between(2 * MS, 11 * MS, 2 * MS)
    np.testing.assert_allclose(table[:, 0], [0.0, 0.003, 0.008, 0.009])
    np.testing.assert_allclose(table[:, 1], [2.0, 5.0, 10.0, 11.0])


def test_beyond_the_last_sample_its_value_is_held():
    table = buffer(0, 5).between(2 * MS, 50 * MS, 0)
    np.testing.assert_allclose(table[-1, :2], [0.05, 5.0])


def test_what_was_used_takes_no_more_samples():
    held = buffer(0, 5, 10, 15)
    held.taken(10 * MS)
    held.add(sample(7))
    assert held.late == 1
    np.testing.assert_allclose(held.between(10 * MS, 15 * MS, 0)[:, 1], [10.0, 15.0])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_is_left_out(value):
    held = buffer(0)
    held.add(sample(5, value))
    assert held.newest_ns == 0
    assert held.late == 1


def test_a_silence_counts_within_the_stretch_asked_for():
    held = buffer(0, 5, 10, 500, 505)
    assert held.gap_s(0, 505 * MS) == pytest.approx(0.49)
    assert held.gap_s(100 * MS, 200 * MS) == pytest.approx(0.1)
    assert held.gap_s(0, 10 * MS) == pytest.approx(0.005)
    assert ImuBuffer().gap_s(0, 100 * MS) == pytest.approx(0.1)
    assert held.covers(0, 12 * MS, 0.05)
    assert not held.covers(0, 505 * MS, 0.05)
    assert not held.covers(500 * MS, 700 * MS, 0.05)


def test_what_nobody_takes_is_not_kept_for_ever():
    held = buffer(*range(0, int(HELD_S * 1000) + 5000, 100))
    assert len(held.window(0, 10**18)) <= HELD_S * 10 + 2


def test_cleared_it_begins_anew():
    held = buffer(0, 5, 10)
    held.taken(10 * MS)
    held.clear()
    held.add(sample(1))
    assert held.newest_ns == MS
    assert held.late == 0
