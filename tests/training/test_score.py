import numpy as np
import pytest

from training.demo_detector.score import Tally

TREES = np.array([[0.0, 0.0, 10.0, 20.0], [30.0, 0.0, 40.0, 20.0]])


def test_recall_counts_the_trees_of_a_range():
    tally = Tally(found_m=[3.0, 12.0], missed_m=[4.0])
    assert (tally.recall(), tally.recall(0.0, 5.0), tally.recall(5.0, 15.0)) == (2 / 3, 0.5, 1.0)


def test_average_precision_is_one_for_all_trees_and_nothing_else_and_counts_a_miss():
    sure = np.array([0.9, 0.8])
    assert Tally(compared=[(TREES, sure, TREES)]).average_precision() == pytest.approx((1.0, 1.0))
    half = Tally(compared=[(TREES[:1], sure[:1], TREES)])
    assert half.average_precision() == pytest.approx((51 / 101, 51 / 101))
    assert half.curve().recall.tolist() == [0.5]
