import numpy as np
import pytest

from pipeline.calibration.board_extrinsics import Hold, from_board
from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.extrinsics import Extrinsics
from tests.pipeline.calibration.boards import FISHEYE, PINHOLE
from tests.pipeline.calibration.rooms import BOARD, TRUE, guess, holds


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE], ids=["pinhole", "fisheye"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_pose_is_found_from_a_bad_guess_and_its_sigmas_are_honest(camera, seed):
    found = from_board(holds(camera, 12, seed), BOARD, camera, guess(seed))
    assert not found.refusal
    error = found.extrinsics.step_from(TRUE)
    assert np.degrees(np.linalg.norm(error[:3])) < 0.25
    assert np.linalg.norm(error[3:]) < 0.012
    assert error @ np.linalg.solve(found.covariance, error) < 22.5  # 99.9 % of chi-squared with 6 degrees of freedom
    assert found.rotation_sigma_deg < 0.3
    assert found.translation_sigma_m < 0.015


def test_the_uncertainty_is_neither_too_small_nor_too_large_over_many_rooms():
    scores = []
    for seed in range(10, 15):
        found = from_board(holds(PINHOLE, 10, seed), BOARD, PINHOLE, guess(seed))
        error = found.extrinsics.step_from(TRUE)
        scores.append(error @ np.linalg.solve(found.covariance, error) / 6.0)
    assert 0.15 < np.mean(scores) < 1.8


def test_more_poses_make_it_surer():
    few, many = (from_board(holds(PINHOLE, count), BOARD, PINHOLE, guess(4)) for count in (6, 24))
    assert many.rotation_sigma_deg < few.rotation_sigma_deg
    assert many.translation_sigma_m < few.translation_sigma_m


def test_a_pose_in_which_something_moved_is_left_out_and_named():
    poses = holds(PINHOLE, 10)
    moved = Hold(poses[3].sighting, poses[3].points_m + np.array([0.08, 0.0, 0.0]))
    found = from_board([*poses[:3], moved, *poses[4:]], BOARD, PINHOLE, guess(5))
    assert {hold.name: hold.why for hold in found.holds if hold.why} == {"pose 3": "it does not agree with the others"}
    assert np.linalg.norm(found.extrinsics.step_from(TRUE)[3:]) < 0.015


def test_a_board_that_was_never_tilted_cannot_be_told():
    found = from_board(holds(PINHOLE, 10, tilt_deg=1.0), BOARD, PINHOLE, guess(6))
    assert "tilt it left, right" in found.refusal


def test_a_board_of_the_wrong_size_cannot_be_told():
    poses = holds(PINHOLE, 10)
    shrunk = [Hold(_scaled(hold.sighting, 0.9), hold.points_m) for hold in poses]
    found = from_board(shrunk, BOARD, PINHOLE, guess(7, degrees=1.0, metres=0.01))
    assert found.refusal


def test_a_board_the_lidar_does_not_see_is_refused():
    empty = [Hold(hold.sighting, hold.points_m[:50]) for hold in holds(PINHOLE, 6)]
    with pytest.raises(CalibrationError, match="in 0 of 6 poses"):
        from_board(empty, BOARD, PINHOLE, guess(8))


def test_a_step_is_undone_by_its_own_measure():
    step = np.array([0.1, -0.2, 0.05, 0.3, -0.1, 0.2])
    assert TRUE.moved(step).step_from(TRUE) == pytest.approx(step)
    assert Extrinsics(np.eye(3), np.array([1.0, 2.0, 3.0])).camera_m == pytest.approx([-1.0, -2.0, -3.0])


def _scaled(sighting, factor):
    return type(sighting)(sighting.name, sighting.board_m * factor, sighting.pixels)
