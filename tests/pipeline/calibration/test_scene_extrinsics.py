import numpy as np
import pytest

from pipeline.calibration.edge_kernels import sample
from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.image_edges import edge_strength, facing
from pipeline.calibration.laser_edges import find_edges
from pipeline.calibration.scene_extrinsics import Stand, from_scene
from pipeline.calibration.view import Straightener
from pipeline.camera import CameraModel
from tests.pipeline.calibration.boards import rays
from tests.pipeline.calibration.rooms import TRUE, guess

CAMERA = CameraModel(424, 240, (216.0, 216.0), (211.5, 119.5))
FISHEYE = CameraModel(424, 240, (200.0, 200.0), (210.0, 121.0), "fisheye", (0.04, -0.01, 0.003, -0.001))


class Posts:
    """Upright and level beams, seen from the LiDAR: each a strip of a vertical plane; grey all different."""

    def __init__(self, seed: int):
        rng = np.random.default_rng(seed)
        self.ahead = rng.uniform(2.0, 8.0, 16)
        self.aside = rng.uniform(-0.9, 0.9, 16) * self.ahead
        self.up = rng.uniform(-0.1, 0.5, 16) * self.ahead
        self.half = rng.uniform(0.08, 0.2, 16)
        self.level = np.arange(16) % 3 == 0
        self.grey = rng.permutation(np.linspace(20, 235, 17))

    def look(self, origin: np.ndarray, towards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (n,) and which (n,), -1 for the wall at 14 m."""
        distance, which = (14.0 - origin[0]) / np.maximum(towards[:, 0], 1e-6), np.full(len(towards), -1)
        for k in np.argsort(-self.ahead):
            reach = (self.ahead[k] - origin[0]) / np.maximum(towards[:, 0], 1e-6)
            y, z = (origin[axis] + reach * towards[:, axis] for axis in (1, 2))
            short = np.abs(z - self.up[k]) < self.half[k] if self.level[k] else np.abs(y - self.aside[k]) < self.half[k]
            long = np.abs(y - self.aside[k]) < 1.5 if self.level[k] else np.ones(len(y), bool)
            hit = short & long & (towards[:, 0] > 0.05)
            distance, which = np.where(hit, reach, distance), np.where(hit, k, which)
        return distance, which

    def stand(self, camera: CameraModel, seed: int) -> Stand:
        rng = np.random.default_rng(seed)
        _, which = self.look(TRUE.camera_m, rays(camera) @ TRUE.rotation)
        grey = self.grey[which].reshape(camera.height_px, camera.width_px)
        image = np.repeat((grey + rng.normal(0, 3, grey.shape)).clip(0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
        azimuth, elevation = rng.uniform(-0.9, 0.9, 80_000), rng.uniform(-0.12, 0.6, 80_000)
        level = np.cos(elevation)
        towards = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
        distance, _ = self.look(np.zeros(3), towards)
        return Stand(image, towards * (distance + rng.normal(0, 0.01, len(distance)))[:, None])


@pytest.fixture(scope="module")
def stands():
    return [Posts(seed).stand(CAMERA, seed) for seed in (1, 2, 3)]


def test_the_pose_is_found_from_a_bad_guess_and_its_sigmas_are_honest(stands):
    found = from_scene(stands, CAMERA, guess(1, degrees=2.5))
    error = found.extrinsics.step_from(TRUE)
    assert not found.refusal
    assert np.degrees(np.linalg.norm(error[:3])) < 0.3
    assert np.linalg.norm(found.extrinsics.camera_m - TRUE.camera_m) < 0.03
    assert error @ np.linalg.solve(found.covariance, error) < 22.5  # 99.9 % of chi-squared with 6 degrees of freedom


@pytest.mark.slow
def test_a_fisheye_lens_is_straightened_first():
    found = from_scene([Posts(seed).stand(FISHEYE, seed) for seed in (1, 2, 3)], FISHEYE, guess(2, degrees=2.0))
    error = found.extrinsics.step_from(TRUE)
    assert np.degrees(np.linalg.norm(error[:3])) < 0.4
    assert np.linalg.norm(found.extrinsics.camera_m - TRUE.camera_m) < 0.04


@pytest.mark.slow
def test_pictures_of_another_place_cannot_be_told(stands):
    mixed = [Stand(stands[(k + 1) % 3].image_bgr, stand.points_m) for k, stand in enumerate(stands)]
    assert from_scene(mixed, CAMERA, guess(3)).refusal


def test_a_bare_wall_is_refused(stands):
    blank = [
        Stand(stand.image_bgr, np.column_stack([np.full(5000, 5.0), *np.random.default_rng(1).normal(0, 1, (2, 5000))]))
        for stand in stands
    ]
    with pytest.raises(CalibrationError, match="use a board"):
        from_scene(blank, CAMERA, guess(4))


def test_the_laser_sees_the_edges_of_posts_and_the_way_out_of_them(stands):
    edges = find_edges(stands[0].points_m, TRUE, CAMERA)
    seen = TRUE.rotation @ edges.points_m.T
    level = np.abs(edges.outward[:, 1]) > 0.9
    upright = np.abs(edges.outward[:, 0]) > 0.9
    assert len(edges) > 300
    assert (level | upright).mean() > 0.8
    post = Posts(1)
    aside = np.abs(edges.points_m[upright, 1][:, None] - (post.aside - post.half)[None])
    other = np.abs(edges.points_m[upright, 1][:, None] - (post.aside + post.half)[None])
    assert np.median(np.minimum(aside, other).min(axis=1)) < 0.04
    assert np.all(seen[2] > 0)


def test_a_line_is_strongest_in_the_direction_across_it():
    image = np.full((80, 80, 3), 60, np.uint8)
    image[:, 40:] = 180
    strength = edge_strength(image)
    assert int(np.argmax(strength[:, 40, 40])) == 0
    assert facing(np.array([[1.0, 0.0], [-1.0, 0.01], [0.0, 1.0]])).tolist() == [0, 0, 4]


def test_sampling_is_bilinear_and_its_slope_is_that_of_the_field():
    rng = np.random.default_rng(1)
    field = rng.normal(size=(3, 12, 15)).astype(np.float32)
    pixels = rng.uniform(-2, 16, (200, 2))
    which = rng.integers(0, 3, 200)
    value, slope = np.empty(200), np.empty((200, 2))
    inside = sample(field, which, pixels, value, slope)

    def at(k, u, v):
        if not (0 <= u < 14 and 0 <= v < 11):
            return 0.0
        c, r = int(u), int(v)
        square = field[k, r : r + 2, c : c + 2].astype(float)
        return float(np.array([1 - (v - r), v - r]) @ square @ np.array([1 - (u - c), u - c]))

    expected = [at(k, u, v) for k, (u, v) in zip(which, pixels, strict=True)]
    assert value == pytest.approx(np.array(expected), abs=1e-5)
    assert inside == sum(0 <= u < 14 and 0 <= v < 11 for u, v in pixels)
    for i in np.flatnonzero((np.abs(pixels % 1 - 0.5) < 0.4).all(axis=1) & (value != 0.0)):
        u, v = pixels[i]
        slow = [
            (at(which[i], u + 0.01, v) - at(which[i], u - 0.01, v)) / 0.02,
            (at(which[i], u, v + 0.01) - at(which[i], u, v - 0.01)) / 0.02,
        ]
        assert slope[i] == pytest.approx(slow, abs=1e-3)


def test_a_straightened_fisheye_picture_shows_straight_lines_where_a_pinhole_would():
    straight = Straightener.of(FISHEYE)
    pinhole, towards = straight.pinhole, rays(FISHEYE)
    stripe = (np.abs(towards[:, 0] / towards[:, 2] - 0.4) < 0.02) * 255
    image = np.repeat(stripe.reshape(240, 424, 1).astype(np.uint8), 3, axis=2)
    seen = straight.straight(image)[:, :, 0].astype(float)
    rows = range(20, 220, 20)
    middle = [np.sum(seen[row] * np.arange(seen.shape[1])) / seen[row].sum() for row in rows]
    assert middle == pytest.approx([pinhole.centre_px[0] + 0.4 * pinhole.focal_px[0]] * len(middle), abs=0.7)


def test_fewer_places_than_three_are_not_believed(stands):
    found = from_scene(stands[:1], CAMERA, guess(1, degrees=2.5))
    assert "at least 3" in found.refusal
