"""The ground from above: slopes are lit from the north-west, stems are dark, nothing is clear."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.products.relief import relief


def picture(cloud, bounds=(0.0, 0.0, 40.0, 40.0)):
    made = relief(lambda: np.array_split(cloud, 3), bounds)
    return made, cv2.imdecode(np.frombuffer(made.png, np.uint8), cv2.IMREAD_UNCHANGED)


def at(made, image, east, north):
    column = int((east - made.west) / (made.east - made.west) * image.shape[1])
    row = int((made.north - north) / (made.north - made.south) * image.shape[0])
    return image[row, column].astype(int)


def ground(height, seed=0, count=400_000):
    xy = np.random.default_rng(seed).uniform(0, 40, (count, 2))
    return np.column_stack([xy, height(xy[:, 0], xy[:, 1])])


def test_a_slope_to_the_north_west_is_lighter_than_one_to_the_south_east():
    ridge = ground(lambda x, y: -0.3 * np.abs(x - y))
    made, image = picture(ridge)
    assert at(made, image, 10, 30)[0] > at(made, image, 30, 10)[0] + 40
    assert at(made, image, 10, 30)[3] == 255


def test_stems_are_dark_and_crowns_are_not():
    random = np.random.default_rng(2)
    flat = ground(lambda x, _: 0.1 * x)
    stem = np.column_stack([random.normal(20, 0.1, (3000, 2)), random.uniform(2.0, 8.0, 3000)])
    crown = np.column_stack([random.normal(30, 1.5, (20_000, 2)), random.uniform(9, 14, 20_000)])
    made, image = picture(np.vstack([flat, stem, crown]))
    assert at(made, image, 20, 20)[0] < 0.5 * at(made, image, 10, 10)[0]
    assert abs(at(made, image, 30, 30)[0] - at(made, image, 10, 10)[0]) < 25


def test_leaves_that_hide_the_ground_make_no_hill():
    random = np.random.default_rng(4)
    flat = ground(lambda x, _: 0.0 * x)
    hidden = np.hypot(flat[:, 0] - 20, flat[:, 1] - 20) < 1.2
    leaves = np.column_stack([random.uniform(18.8, 21.2, (5000, 2)), random.uniform(6, 8, 5000)])
    made, image = picture(np.vstack([flat[~hidden], leaves]))
    around = [at(made, image, 20 + 3 * np.cos(a), 20 + 3 * np.sin(a))[0] for a in np.linspace(0, 6, 12)]
    assert max(around) - min(around) < 12
    assert abs(at(made, image, 20, 20)[0] - around[0]) < 12


def test_where_nothing_was_seen_the_picture_is_clear():
    half = ground(lambda x, _: 0.0 * x)
    made, image = picture(half[half[:, 0] < 20])
    assert at(made, image, 10, 20)[3] == 255
    assert at(made, image, 35, 20)[3] == 0
    assert relief(lambda: [], (0, 0, 10, 10)) is None
    assert relief(lambda: [np.array([[50.0, 50.0, 1.0]])], (0, 0, 10, 10)) is None
