import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.evaluation.trees import tree_errors
from pipeline.trees import Tree

PLACES = np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0], [40.0, 0.0]])
WANTED = np.array([True, True, True, False])


def tree(number, x, y=0.0, probability=0.9, sigma_m=0.3):
    covariance = np.diag([sigma_m**2, sigma_m**2, 0.04])
    return Tree(number, "tree-of-heaven", "map", np.array([x, y, 0.0]), covariance, probability, 5, 4, 100,
                True, 8.0, 3.0, 0, 1, ())  # fmt: skip


def test_found_missed_made_up_and_improbable():
    errors = tree_errors(
        [tree(1, 0.3), tree(2, 5.0, 0.4), tree(3, 20.0), tree(4, 10.0, probability=0.3)], PLACES, WANTED
    )
    assert (errors.true, errors.found, errors.mapped, errors.right) == (3, 2, 3, 2)
    assert (errors.missed, errors.made_up) == ((2,), (3,))
    assert errors.recall == pytest.approx(2 / 3)
    assert errors.precision == pytest.approx(2 / 3)
    assert errors.error_median_m == pytest.approx(0.35)
    assert errors.error_worst_m == pytest.approx(0.4)
    assert errors.nees == pytest.approx((1.0 + (0.4 / 0.3) ** 2) / 4)
    assert errors.within_95 == 1.0


def test_a_target_that_need_not_be_found_is_right_where_it_is():
    errors = tree_errors([tree(1, 40.1)], PLACES, WANTED)
    assert (errors.right, errors.found, errors.precision, errors.recall) == (1, 0, 1.0, 0.0)


def test_two_on_one_are_one_and_one_too_many():
    errors = tree_errors([tree(1, 0.1), tree(2, 0.5)], PLACES[:1], WANTED[:1])
    assert (errors.right, errors.made_up) == (1, (2,))


def test_nothing_is_no_error():
    errors = tree_errors([], PLACES, WANTED)
    assert (errors.found, errors.recall) == (0, 0.0)
    assert math.isnan(errors.precision)
    assert math.isnan(tree_errors([], PLACES[:0], WANTED[:0]).recall)
    assert math.isnan(tree_errors([replace(tree(1, 99.0))], PLACES, WANTED).nees)
