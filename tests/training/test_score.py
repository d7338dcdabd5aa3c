import numpy as np
import pytest

from training.demo_detector.score import Tally, iou, matched

TREES = np.array([[0.0, 0.0, 10.0, 20.0], [30.0, 0.0, 40.0, 20.0]])


def test_each_tree_is_found_once_by_the_surest_box():
    boxes = np.array([[0.0, 0.0, 10.0, 19.0], [0.0, 0.0, 10.0, 20.0], [31.0, 0.0, 40.0, 20.0], [60.0, 0.0, 70.0, 9.0]])
    assert matched(boxes, TREES).tolist() == [0, -1, 1, -1]
    assert matched(boxes, np.empty((0, 4))).tolist() == [-1] * 4
    assert iou(boxes, TREES)[0].tolist() == pytest.approx([0.95, 0.0])


def test_average_precision_is_the_area_under_the_curve():
    scored = [(0.9, True), (0.8, False), (0.7, True), (0.1, False)]
    tally = Tally(scored=scored, found_m=[3.0, 4.0], missed_m=[])
    # Precision 1 up to a recall of one half, two thirds beyond: 51 and 50 of the 101 points.
    assert tally.average_precision == pytest.approx((51 + 50 * 2 / 3) / 101)
    assert Tally(scored=[], found_m=[], missed_m=[1.0]).average_precision == 0.0


def test_recall_counts_the_trees_of_a_range():
    tally = Tally(found_m=[3.0, 12.0], missed_m=[4.0])
    assert (tally.recall(), tally.recall(0.0, 5.0), tally.recall(5.0, 15.0)) == (2 / 3, 0.5, 1.0)
