"""An image in the input of a model, and boxes back in the image."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.detection.letterbox import PAD, Letterbox, fit, snug

SIDES = st.integers(1, 4000)


def slow(image, input_px):
    """The same, pixel formats and all, as plainly as it goes."""
    height, width, _ = image.shape
    scale = min(input_px[0] / height, input_px[1] / width)
    inner = cv2.resize(image, (round(width * scale), round(height * scale)), interpolation=cv2.INTER_LINEAR)
    canvas = np.full((*input_px, 3), PAD, np.uint8)
    top, left = (input_px[0] - inner.shape[0]) // 2, (input_px[1] - inner.shape[1]) // 2
    canvas[top : top + inner.shape[0], left : left + inner.shape[1]] = inner
    return (canvas[..., ::-1].transpose(2, 0, 1)[None] / 255.0).astype(np.float32)


@pytest.mark.parametrize("image_px", [(480, 848), (1080, 1920), (333, 77), (64, 96), (1, 1), (7, 1000)])
@pytest.mark.parametrize("input_px", [(64, 96), (416, 416), (352, 640)])
def test_the_input_is_rgb_with_grey_around_it(image_px, input_px):
    image = np.random.default_rng(1).integers(0, 256, (*image_px, 3), np.uint8)
    box = Letterbox(input_px)
    box.put(np.zeros((50, 300, 3), np.uint8))
    box.put(image)
    np.testing.assert_allclose(box.blob, slow(image, input_px), atol=1e-6)


def test_half_precision_is_filled_as_well():
    image = np.random.default_rng(1).integers(0, 256, (50, 90, 3), np.uint8)
    box = Letterbox((64, 96), np.float16)
    box.put(image)
    np.testing.assert_allclose(box.blob, slow(image, (64, 96)), atol=1e-3)


@given(SIDES, SIDES, st.sampled_from([(832, 832), (480, 832), (352, 640)]))
def test_the_image_lies_inside_and_touches_two_sides(height, width, input_px):
    found = fit((height, width), input_px)
    for inner, start, whole in zip(found.inner_px, (found.top_px, found.left_px), input_px, strict=True):
        assert start >= 0
        assert start + inner <= whole
    assert found.inner_px[0] == input_px[0] or found.inner_px[1] == input_px[1]


@given(st.integers(20, 4000), st.integers(20, 4000), st.integers(0, 2**32 - 1))
def test_boxes_come_back_exactly_where_the_resize_took_them_from(height, width, seed):
    found = fit((height, width), (480, 832))
    rng = np.random.default_rng(seed)
    corners = np.sort(rng.uniform(0, 1, (5, 2, 2)), axis=1) * (width, height)
    boxes = corners.reshape(5, 4)
    forth = boxes * (np.array(found.inner_px[::-1] * 2) / (width, height, width, height))
    forth += [found.left_px, found.top_px] * 2
    np.testing.assert_allclose(found.undo(forth), boxes, atol=1e-9 * max(height, width))


def test_what_reaches_over_the_image_is_clipped_to_it():
    found = fit((100, 300), (64, 96))
    np.testing.assert_array_equal(found.undo(np.array([[-5.0, -5.0, 200.0, 200.0]])), [[0, 0, 300, 100]])


@pytest.mark.parametrize(
    ("image_px", "longest", "expected"),
    [((480, 848), 832, (480, 832)), ((1080, 1920), 640, (384, 640)), ((1920, 1080), 640, (640, 384))],
)
def test_an_open_input_is_no_larger_than_the_image_needs(image_px, longest, expected):
    assert snug(image_px, longest, 32) == expected
