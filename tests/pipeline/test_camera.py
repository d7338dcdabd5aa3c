import numpy as np
import pytest

from pipeline.camera import CameraModel

PINHOLE = CameraModel(848, 480, (432.0, 430.0), (423.5, 239.5), "pinhole", (-0.2, 0.05, 0.001, -0.002, 0.0))
FISHEYE = CameraModel(1920, 1208, (1180.1, 1179.2), (967.7, 601.7), "fisheye", (-0.1, 0.05, -0.087, 0.045))


def test_without_distortion_it_is_similar_triangles():
    plain = CameraModel(848, 480, (400.0, 410.0), (423.5, 239.5))
    pixels, seen = plain.project(np.array([[1.0, -0.5, 4.0], [0.0, 0.0, -2.0], [9.0, 0.0, 1.0]]))
    np.testing.assert_allclose(pixels[0], [423.5 + 100.0, 239.5 - 51.25])
    assert seen.tolist() == [True, False, False]


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE, CameraModel(848, 480, (400.0, 410.0), (423.5, 239.5))])
def test_a_ray_goes_through_the_pixel_it_came_from(camera):
    pixels = np.random.default_rng(1).uniform([20, 20], [camera.width_px - 20, camera.height_px - 20], (200, 2))
    rays = camera.rays(pixels)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
    again, seen = camera.project(7.0 * rays)
    assert seen.all()
    np.testing.assert_allclose(again, pixels, atol=0.05)


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE])
def test_at_half_the_size_a_point_lands_at_half_the_place(camera):
    half = camera.resized(camera.width_px // 2, camera.height_px // 2)
    points = np.array([[0.3, -0.4, 3.0], [-1.0, 0.2, 4.0]])
    np.testing.assert_allclose(half.project(points)[0] + 0.5, (camera.project(points)[0] + 0.5) / 2, atol=1e-9)


def test_nothing_gives_nothing():
    pixels, seen = PINHOLE.project(np.empty((0, 3)))
    assert pixels.shape == (0, 2)
    assert seen.shape == (0,)
    assert PINHOLE.rays(np.empty((0, 2))).shape == (0, 3)
