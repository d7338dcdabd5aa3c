"""The depth image and what is hidden in it, against slow and obvious versions."""

import numpy as np
import pytest

from pipeline.camera import CameraModel
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.depth import DepthImage, lens_numbers
from pipeline.grounding.lens_kernels import look, splat, unhidden
from pipeline.grounding.surroundings import Surroundings
from tests.pipeline.grounding.grove import CAMERA, looking

LENSES = [
    CAMERA,
    CameraModel(848, 480, (432.0, 430.0), (423.5, 239.5), "pinhole", (-0.2, 0.05, 0.001, -0.002, 0.0)),
    CameraModel(1920, 1208, (1180.1, 1179.2), (967.7, 601.7), "fisheye", (-0.1, 0.05, -0.087, 0.045)),
]


@pytest.mark.parametrize("model", LENSES)
def test_points_land_where_the_camera_model_puts_them(model):
    random = np.random.default_rng(2)
    points = random.uniform([-10, -10, -3], [10, 10, 4], (4000, 3))
    view = looking(0.5, -0.3, 0.7)
    size, ranges = np.array([model.width_px, model.height_px], float), np.array([0.5, 9.0])
    seen = look(points, view.rotation, view.position_m, lens_numbers(model), size, ranges)
    away = points - view.position_m
    range_m = np.linalg.norm(away, axis=1)
    pixels, inside = model.project(away @ view.rotation)
    expected = inside & (range_m > 0.5) & (range_m < 9.0)
    assert expected.sum() > 100
    np.testing.assert_array_equal(seen[:, 2] > 0, expected)
    np.testing.assert_allclose(seen[expected, :2], pixels[expected], atol=1e-3)
    np.testing.assert_allclose(seen[expected, 2], range_m[expected], rtol=1e-6)


def test_a_cell_holds_the_nearest_point_that_covers_it():
    random = np.random.default_rng(3)
    seen = np.column_stack([random.uniform(0, 80, 60), random.uniform(0, 40, 60), random.uniform(1, 9, 60)])
    seen = seen.astype(np.float32)
    depth = np.full((10, 20), np.inf, np.float32)
    splat(seen, 4.0, 30.0, depth)
    expected = np.full((10, 20), np.inf, np.float32)
    for u, v, r in seen:
        half = min(int(30.0 / (r * 4.0)), 5)
        for i in range(10):
            for j in range(20):
                if abs(i - int((v + 0.5) / 4)) <= half and abs(j - int((u + 0.5) / 4)) <= half:
                    expected[i, j] = min(expected[i, j], r)
    np.testing.assert_array_equal(depth, expected)
    shown = unhidden(seen, 4.0, 0.4, depth)
    rows, cols = ((seen[:, 1] + 0.5) / 4).astype(int), ((seen[:, 0] + 0.5) / 4).astype(int)
    np.testing.assert_array_equal(shown, seen[:, 2] <= expected[rows, cols] * 1.02 + 0.4)


def test_what_stands_behind_a_wall_is_hidden():
    y, z = np.meshgrid(np.arange(-3, 3, 0.05), np.arange(0, 3, 0.05))
    wall = np.column_stack([np.full(y.size, 4.0), y.ravel(), z.ravel()])
    around = Surroundings.of(np.zeros(3), np.concatenate([wall, [[7.0, 0.0, 1.3], [7.0, 5.5, 1.3]]]))
    depth = DepthImage(looking(0.0, 0.0, 0.0), around, GroundingConfig())
    assert depth.unhidden(depth.seen)[-2:].tolist() == [False, True]
    middle = depth.places_m[60, 106]
    np.testing.assert_allclose(middle, [4.0, 0.0, 1.3], atol=0.06)
