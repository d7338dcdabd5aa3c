"""Inertial samples that overtook each other. Times in sample periods of 5 ms."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.livox.order import Sample, SampleOrder

PERIOD_NS = 5_000_000


def passed(arrivals):
    """What goes out of (number, missing) as (number, reception), the reception counted from 1."""
    out = []
    order = SampleOrder(out.append)
    used = [order.take(Sample(at * PERIOD_NS, n, ()), missing) for n, (at, missing) in enumerate(arrivals, 1)]
    order.release()
    return [(one.sensor_ns // PERIOD_NS, one.receive_ns) for one in out], used


def test_in_order_nothing_is_held():
    out = []
    order = SampleOrder(out.append)
    for at in range(5):
        order.take(Sample(at, at, ()), 0)
        assert len(out) == at + 1


def test_one_that_was_overtaken_takes_its_place_again():
    out, used = passed([(1, 0), (3, 1), (2, -1), (4, 0)])
    assert out == [(1, 1), (2, 3), (3, 3), (4, 4)]
    assert all(used)


def test_one_that_is_lost_holds_up_the_others_for_a_moment():
    out = []
    order = SampleOrder(out.append)
    order.take(Sample(0, 0, ()), 0)
    for at in range(2, 6):
        order.take(Sample(at * PERIOD_NS, at, ()), int(at == 2))
        assert len(out) == 1
    order.take(Sample(6 * PERIOD_NS, 6, ()), 0)
    assert len(out) == 6
    assert not order.take(Sample(PERIOD_NS, 7, ()), -1)


def test_a_loss_does_not_cost_those_that_are_overtaken_after_it():
    out, used = passed([(0, 0), (2, 1), (3, 0), (4, 0), (6, 1), (5, -1), (8, 1), (7, -1), (9, 0)])
    assert [number for number, _ in out] == [0, 2, 3, 4, 5, 6, 7, 8, 9]
    assert all(used)


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(-2, 6))))
def test_whatever_comes_time_never_goes_back_and_nothing_usable_is_lost(arrivals):
    out, used = passed(arrivals)
    assert [number for number, _ in out] == sorted(number for number, _ in out)
    assert [receive for _, receive in out] == sorted(receive for _, receive in out)
    assert len(out) == sum(used)
