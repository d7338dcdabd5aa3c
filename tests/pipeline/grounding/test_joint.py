import numpy as np
import pytest

from pipeline.grounding.joint import Claims, settled

PRIOR = np.full(3, -3.0)


def _view(which: list[int], fit: list[float], missed: list[float]) -> Claims:
    """One box that may mean each of them."""
    count = len(which)
    gain = np.full((count, 1), 15.0)
    return Claims(np.array(which), np.ones(count), np.array(fit)[:, None], gain, np.array(missed))


def test_a_stem_in_line_with_a_tree_gets_none_of_its_boxes():
    """Tree 0 is meant from everywhere; 1 and 2 fit a little better, each from one side only, and stand empty from the
    other."""
    left = _view([0, 1], [1.0, 1.3], [-1.0, -0.4])
    right = _view([0, 2], [1.0, 1.3], [-1.0, -0.4])
    empty = np.array([0.0, -2.0, -2.0])
    odds = settled(PRIOR + empty, [left, left, right, right], 8.0)
    assert odds[0] > 3.0
    assert max(odds[1:]) < 0.0


def test_two_trees_with_a_box_each_are_both_there():
    gain = np.full((2, 2), 15.0)
    both = Claims(np.array([0, 1]), np.ones(2), np.array([[1.0, 0.4], [0.4, 1.0]]), gain, np.full(2, -1.0))
    assert min(settled(PRIOR, [both] * 4, 8.0)[:2]) > 2.0


def test_one_that_a_box_alone_means_gets_all_of_its_weight():
    odds = settled(PRIOR, [_view([1], [1e3], [-1.0])], 8.0)
    assert odds == pytest.approx([-3.0, -3.0 + np.log(15.0), -3.0], abs=0.01)


def test_a_view_that_is_not_fresh_counts_as_a_part_of_one():
    one = _view([1], [1e3], [-1.0])
    stale = Claims(one.which, np.array([0.1]), one.fit, one.gain, one.missed)
    assert settled(PRIOR, [stale], 8.0)[1] == pytest.approx(-3.0 + 0.1 * np.log(15.0), abs=0.01)


def test_no_box_leaves_what_was_known():
    assert np.array_equal(settled(PRIOR, [], 8.0), PRIOR)
