"""Outputs of all layouts, against a suppression that compares every pair."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.detection.decode import MOST_CANDIDATES, Found, decode, suppress
from pipeline.detection.layout import Layout


def iou(a, b) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    both = max(width, 0.0) * max(height, 0.0)
    return both / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both)


def slow(found: Found, most_iou: float) -> list[int]:
    kept: list[int] = []
    for i in range(len(found.boxes)):
        rivals = [j for j in kept if found.class_id[j] == found.class_id[i]]
        if all(iou(found.boxes[i], found.boxes[j]) <= most_iou for j in rivals):
            kept.append(i)
    return kept


def crowd(count: int, classes: int, seed: int = 0) -> np.ndarray:
    """(4 + classes, count): boxes on top of each other."""
    rng = np.random.default_rng(seed)
    return np.vstack([rng.uniform(50, 90, (2, count)), rng.uniform(10, 60, (2, count)), rng.random((classes, count))])


@pytest.mark.parametrize("classes", [1, 2, 5])
@pytest.mark.parametrize("seed", range(5))
def test_the_surest_of_what_overlaps_stays_and_classes_do_not_mind_each_other(classes, seed):
    output = crowd(80, classes, seed)[None].astype(np.float32)
    found = decode(output, Layout.ROWS, 0.4)
    best = output[0, 4:].max(axis=0)
    np.testing.assert_allclose(found.confidence, np.sort(best[best >= np.float32(0.4)])[::-1])
    kept = suppress(found, 0.5, 300)
    np.testing.assert_array_equal(kept.boxes, found.boxes[slow(found, 0.5)])
    assert 0 < len(kept.boxes) < len(found.boxes)


def test_both_ways_of_writing_it_say_the_same():
    output = crowd(60, 3)[None].astype(np.float32)
    rows, columns = decode(output, Layout.ROWS, 0.3), decode(output.transpose(0, 2, 1).copy(), Layout.COLUMNS, 0.3)
    for name in ("boxes", "confidence", "class_id"):
        np.testing.assert_array_equal(getattr(rows, name), getattr(columns, name))


def test_final_boxes_are_taken_as_they_are_and_empty_rows_left_out():
    output = np.zeros((1, 300, 6), np.float32)
    output[0, 0] = [10, 20, 30, 40, 0.5, 2]
    output[0, 1] = [11, 21, 31, 41, 0.9, 2]
    found = decode(output, Layout.FINAL, 0.35)
    np.testing.assert_allclose(found.boxes, [[11, 21, 31, 41], [10, 20, 30, 40]])
    np.testing.assert_allclose(found.confidence, [0.9, 0.5])
    assert found.class_id.tolist() == [2, 2]


def test_nothing_found_is_nothing():
    found = suppress(decode(np.zeros((1, 5, 100), np.float32), Layout.ROWS, 0.35), 0.5, 10)
    assert (found.boxes.shape, len(found.confidence), len(found.class_id)) == ((0, 4), 0, 0)


def test_numbers_that_are_none_are_not_found():
    output = crowd(10, 1)[None].astype(np.float32)
    output[0, 4] = np.nan
    assert len(decode(output, Layout.ROWS, 0.0).boxes) == 0


def test_a_confidence_near_zero_keeps_the_surest_only():
    output = crowd(8400, 1)[None].astype(np.float32)
    assert len(decode(output, Layout.ROWS, 0.001).boxes) == MOST_CANDIDATES
    assert len(suppress(decode(output, Layout.ROWS, 0.001), 0.99, 100).boxes) == 100
