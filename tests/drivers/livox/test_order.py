"""Inertial samples that overtook each other."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.livox.order import PATIENCE, Sample, SampleOrder


def passed(arrivals):
    """What goes out of (sensor_ns, missing), with the reception counted from 1."""
    out = []
    order = SampleOrder(out.append)
    used = [order.take(Sample(at, receive, ()), missing) for receive, (at, missing) in enumerate(arrivals, 1)]
    order.release()
    return out, used


def test_in_order_nothing_is_held():
    out = []
    order = SampleOrder(out.append)
    for at in range(5):
        order.take(Sample(at, at, ()), 0)
        assert len(out) == at + 1


def test_one_that_was_overtaken_takes_its_place_again():
    out, used = passed([(1, 0), (3, 1), (2, -1), (4, 0)])
    assert [(one.sensor_ns, one.receive_ns) for one in out] == [(1, 1), (2, 3), (3, 3), (4, 4)]
    assert all(used)


def test_one_that_is_lost_holds_up_the_others_for_a_moment():
    out = []
    order = SampleOrder(out.append)
    order.take(Sample(0, 0, ()), 0)
    for at in range(2, 2 + PATIENCE):
        order.take(Sample(at, at, ()), int(at == 2))
        assert len(out) == 1
    order.take(Sample(9, 9, ()), 0)
    assert [one.sensor_ns for one in out] == [0, 2, 3, 4, 5, 9]
    assert not order.take(Sample(1, 10, ()), -1)


def test_a_long_loss_holds_up_nothing():
    out, _ = passed([(1, 0), (900, 898)])
    assert len(out) == 2


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(-2, 6))))
def test_whatever_comes_time_never_goes_back_and_nothing_usable_is_lost(arrivals):
    out, used = passed(arrivals)
    stamps, receptions = [one.sensor_ns for one in out], [one.receive_ns for one in out]
    assert stamps == sorted(stamps)
    assert receptions == sorted(receptions)
    assert len(out) == sum(used)
