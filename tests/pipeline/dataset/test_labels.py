"""Label files read back as they were written, and each line that is no box is named."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pipeline.dataset.labels import Box, format_labels, read_labels

SHARES = st.floats(0.0, 1.0, allow_nan=False)


@st.composite
def boxes(draw):
    """Any box with an area in the image."""
    x0, x1, y0, y1 = (draw(SHARES) for _ in range(4))
    assume(abs(x1 - x0) > 1e-4)
    assume(abs(y1 - y0) > 1e-4)
    size = abs(x1 - x0), abs(y1 - y0)
    return Box(draw(st.integers(0, 80)), (x0 + x1) / 2, (y0 + y1) / 2, *size, draw(st.sampled_from([0.0, 0.25, 1.0])))


@given(st.lists(boxes(), max_size=5), st.booleans())
def test_what_is_written_reads_back_and_is_written_the_same(given_boxes, predictions):
    text = format_labels(given_boxes, predictions=predictions)
    found = read_labels(text, "a.txt", predictions=predictions)
    assert found.problems == ()
    assert found.clipped == 0
    assert len(found.boxes) + found.repeated == len(given_boxes)
    if not found.repeated:
        for one, other in zip(found.boxes, given_boxes, strict=True):
            assert one.class_id == other.class_id
            assert one.confidence == (other.confidence if predictions else 1.0)
            assert (one.cx, one.cy, one.w, one.h) == pytest.approx((other.cx, other.cy, other.w, other.h), abs=6e-7)
        assert format_labels(found.boxes, predictions=predictions) == text


@given(st.text(max_size=80))
def test_any_text_gives_boxes_in_the_image_or_problems_with_their_line(text):
    found = read_labels(text, "a.txt")
    for box in found.boxes:
        x_min, y_min, x_max, y_max = box.corners
        assert -1e-6 <= x_min < x_max <= 1 + 1e-6
        assert -1e-6 <= y_min < y_max <= 1 + 1e-6
    assert all(problem.startswith("a.txt:") for problem in found.problems)


@given(st.lists(st.tuples(SHARES, SHARES), min_size=3, max_size=12))
def test_a_polygon_becomes_its_bounding_box(points):
    xs, ys = zip(*points, strict=True)
    assume(max(xs) - min(xs) > 1e-4)
    assume(max(ys) - min(ys) > 1e-4)
    line = "2 " + " ".join(f"{x!r} {y!r}" for x, y in points)
    (box,) = read_labels(line, "a.txt").boxes
    assert box.class_id == 2
    assert box.corners == pytest.approx((min(xs), min(ys), max(xs), max(ys)), abs=1e-12)


def test_polygons_and_boxes_mix_and_an_empty_file_is_a_negative():
    found = read_labels("0 0.5 0.5 0.2 0.2\n1 0.1 0.1 0.3 0.1 0.3 0.4\n\n", "a.txt", 2)
    assert [box.class_id for box in found.boxes] == [0, 1]
    assert found.polygons == 1
    assert read_labels("", "a.txt").boxes == ()


def test_a_box_over_the_edge_is_cut_there():
    found = read_labels("0 0.99 0.5 0.1 0.2\n0 -0.01 0.5 0.2 1.02", "a.txt")
    assert found.clipped == 2
    assert found.boxes[0].corners == pytest.approx((0.94, 0.4, 1.0, 0.6))
    assert found.boxes[1].corners == pytest.approx((0.0, 0.0, 0.09, 1.0))


def test_the_same_box_twice_counts_once_but_two_classes_of_one_box_stay():
    found = read_labels("0 0.5 0.5 0.2 0.2\n0 0.5 0.5 0.2 0.2\n1 0.5 0.5 0.2 0.2", "a.txt")
    assert [box.class_id for box in found.boxes] == [0, 1]
    assert found.repeated == 1


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("0 0.5 0.5 0.2", "4 values"),
        ("0 0.5 0.5 0.2 0.2 0.9", "prediction"),
        ("0 0.1 0.1 0.2 0.2 0.3 0.3 0.4", "8 values"),
        ("0 0.5 x 0.2 0.2", "'x' is not a number"),
        ("0 0.5 nan 0.2 0.2", "'nan' is not a number"),
        ("0 512 300 40 40", "512 is far outside 0..1; pixels?"),
        ("0 -0.2 0.5 0.2 0.2", "-0.2 is far outside"),
        ("0 0.5 0.5 -0.01 0.2", "negative"),
        ("0 0.5 0.5 0 0.2", "no area"),
        ("0.5 0.5 0.5 0.2 0.2", "not a row of classes.txt"),
        ("-1 0.5 0.5 0.2 0.2", "not a row of classes.txt"),
        ("3 0.5 0.5 0.2 0.2", "classes.txt has 3 rows"),
    ],
)
def test_a_line_that_is_no_box_is_named_with_its_place_and_the_others_are_read(line, why):
    found = read_labels(f"0 0.5 0.5 0.2 0.2\n{line}\n", "labels/a.txt", 3)
    (problem,) = found.problems
    assert problem.startswith("labels/a.txt:2: ")
    assert why in problem
    assert len(found.boxes) == 1


def test_a_prediction_may_carry_its_confidence():
    (box,) = read_labels("0 0.5 0.5 0.2 0.2 0.875", "a.txt", predictions=True).boxes
    assert box.confidence == 0.875
    assert read_labels("0 0.5 0.5 0.2 0.2 1.5", "a.txt", predictions=True).problems
