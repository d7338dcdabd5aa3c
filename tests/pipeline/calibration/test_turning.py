import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.image_turning import Picture, rotation_between, turning_of
from pipeline.calibration.turning import Angle, of_gyro
from pipeline.camera import CameraModel
from tests.pipeline.calibration.turns import MOUNTED, SECOND, Turns

CAMERA = CameraModel(320, 180, (160.0, 160.0), (159.5, 89.5))


def test_the_mean_rate_of_a_sine_is_the_difference_of_its_integral():
    at = np.arange(0.0, 4.0, 0.005)
    rate = np.sin(3.0 * at)[:, None] * [1.0, 0.0, 2.0]
    angle = Angle(of_gyro((at * SECOND).astype(np.int64), rate))
    begin, end = np.array([SECOND, 2 * SECOND]), np.array([SECOND + 33_000_000, 2 * SECOND + 40_000_000])
    later = 0.25
    b, e = begin / SECOND + later, end / SECOND + later
    expected = (np.cos(3.0 * b) - np.cos(3.0 * e)) / 3.0 / (e - b)
    assert angle.mean_rate(begin, end, later)[:, 0] == pytest.approx(expected, abs=2e-4)
    assert angle.mean_rate(begin, end, later)[:, 2] == pytest.approx(2.0 * expected, abs=4e-4)


def test_a_hole_in_the_gyroscope_and_its_ends_are_not_covered():
    at = np.r_[np.arange(0.0, 1.0, 0.005), np.arange(1.5, 3.0, 0.005)]
    angle = Angle(of_gyro((at * SECOND).astype(np.int64), np.zeros((len(at), 3))))
    begin = np.array([-0.1, 0.2, 0.95, 1.2, 1.6, 2.98])
    covered = angle.covers((begin * SECOND).astype(np.int64), ((begin + 0.1) * SECOND).astype(np.int64), 0.0)
    assert covered.tolist() == [False, True, False, False, True, False]


def test_samples_out_of_order_and_twice_are_put_right():
    stamps = np.array([0, 10, 5, 10, 15], np.int64) * 1_000_000
    turning = of_gyro(stamps, np.array([[0.0], [2.0], [1.0], [9.0], [3.0]]) * np.ones(3))
    assert turning.middle_ns.tolist() == [0, 5_000_000, 10_000_000, 15_000_000]
    assert turning.rate[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0]


def test_one_sample_is_no_gyroscope():
    with pytest.raises(CalibrationError, match="at least two"):
        of_gyro(np.array([3], np.int64), np.zeros((1, 3)))


def test_a_rotation_is_found_among_features_that_the_travel_moved():
    rng = np.random.default_rng(1)
    points = rng.uniform([-6, -4, 4], [6, 4, 60], (200, 3))
    turn = Rotation.from_rotvec([0.01, -0.02, 0.015])
    moved = turn.inv().apply(points - [0.01, 0.0, 0.03])
    first, second = (p / np.linalg.norm(p, axis=1, keepdims=True) for p in (points, moved))
    second[:20] = rng.permutation(second[:20])  # and some that were followed wrongly
    assert rotation_between(first, second) == pytest.approx(turn.as_rotvec(), abs=1.5e-3)


def test_pictures_of_a_turning_camera_give_its_rates():
    turns = Turns(seed=3, seconds=3.0)
    turning = turning_of(turns.pictures(CAMERA), CAMERA)
    begin, end = (turns.orientation(stamps / SECOND) * MOUNTED for stamps in (turning.begin_ns, turning.end_ns))
    expected = (begin.inv() * end).as_rotvec() / 0.05
    assert len(turning) > 50
    assert np.sqrt(np.mean((turning.rate - expected) ** 2)) < 0.03 * np.sqrt(np.mean(expected**2))


def test_pictures_that_show_nothing_are_refused():
    blank = [Picture(k * 50_000_000, np.full((180, 320), 90, np.uint8)) for k in range(5)]
    with pytest.raises(CalibrationError, match="nothing in the pictures can be followed"):
        turning_of(blank, CAMERA)


def test_pictures_of_another_size_than_the_lens_are_refused():
    with pytest.raises(CalibrationError, match="640x360 pixels, the lens is calibrated for 320x180"):
        turning_of([Picture(0, np.zeros((360, 640), np.uint8))], CAMERA)
