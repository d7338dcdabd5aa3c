from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.calibration.board import Board, Sighting, find, picture
from pipeline.calibration.choice import Choice
from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.lens import board_pose, fit_lens
from tests.pipeline.calibration.boards import CHARUCO, CHESS, FISHEYE, PINHOLE, photograph, poses, sightings

REAL = Path(__file__).parents[3] / "../shared/data/calibration"
SIZE = (848, 480)


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE], ids=["pinhole", "fisheye"])
def test_the_lens_is_found_from_noisy_corners(camera):
    found = fit_lens(sightings(camera, 30), SIZE, camera.model)
    assert found.rms_px == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    assert found.camera.focal_px == pytest.approx(camera.focal_px, rel=3e-3)
    assert found.camera.centre_px == pytest.approx(camera.centre_px, abs=2.0)
    everywhere = camera.rays(np.array([[100.0, 100.0], [700.0, 60.0], [424.0, 440.0], [424.0, 240.0]]))
    assert np.abs(found.camera.project(everywhere)[0] - camera.project(everywhere)[0]).max() < 1.0
    assert not found.concerns


def test_a_picture_with_wrong_corners_is_left_out_and_named():
    good = sightings(PINHOLE, 25)
    bent = good[4].pixels + np.random.default_rng(3).normal(0.0, 4.0, good[4].pixels.shape)
    good[4] = Sighting("bent.png", good[4].board_m, bent)
    found = fit_lens(good, SIZE, "pinhole")
    assert [view.name for view in found.views if not view.used] == ["bent.png"]
    assert found.views[4].rms_px > 2.0
    assert found.rms_px < 0.2


def test_a_board_that_always_faced_the_camera_is_a_concern():
    found = fit_lens(sightings(PINHOLE, 20, tilt_deg=3.0), SIZE, "pinhole")
    assert any("tilt it" in concern for concern in found.concerns)


def test_a_board_in_the_middle_only_is_a_concern():
    middle = [o for o in sightings(PINHOLE, 60, near_m=0.9) if np.linalg.norm(o.pixels.mean(axis=0) - [424, 240]) < 220]
    found = fit_lens(middle, SIZE, "pinhole")
    assert any("of the picture only" in concern for concern in found.concerns)
    assert found.coverage.sum() == sum(len(one.pixels) for one in middle)


def test_the_wrong_model_of_a_lens_is_a_concern():
    wide = sightings(FISHEYE, 20)
    strong = [Sighting(one.name, one.board_m, one.pixels + 6.0 * np.sin(one.pixels / 40.0)) for one in wide]
    assert any("left over" in concern for concern in fit_lens(strong, SIZE, "pinhole").concerns)


def test_too_few_pictures_are_refused():
    with pytest.raises(CalibrationError, match="found in 3 pictures, at least 6"):
        fit_lens(sightings(PINHOLE, 3), SIZE, "pinhole")


@pytest.mark.parametrize("board", [CHESS, CHARUCO], ids=["chessboard", "charuco"])
@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE], ids=["pinhole", "fisheye"])
def test_corners_are_found_in_pictures_to_a_fraction_of_a_pixel(board, camera):
    turn, move = Rotation.from_euler("xyz", [20.0, -15.0, 5.0], degrees=True), np.array([-0.15, -0.08, 0.4])
    found = find(board, "photo", photograph(board, camera, turn, move))
    assert found is not None
    expected = camera.project(turn.apply(found.board_m) + move)[0]
    apart = np.linalg.norm(found.pixels - expected, axis=1)
    if apart.max() > 5:  # a chessboard counted from its other end
        apart = np.linalg.norm(found.pixels[::-1] - expected, axis=1)
    assert np.sqrt(np.mean(apart**2)) < 0.15
    assert len(found.pixels) > 35


def test_a_charuco_board_is_used_where_only_a_part_of_it_is_seen():
    turn, move = Rotation.from_euler("x", 10.0, degrees=True), np.array([0.12, -0.08, 0.3])
    found = find(CHARUCO, "photo", photograph(CHARUCO, PINHOLE, turn, move))
    assert found is not None
    assert 8 <= len(found.pixels) < 40
    assert np.linalg.norm(found.pixels - PINHOLE.project(turn.apply(found.board_m) + move)[0], axis=1).max() < 0.5


@pytest.mark.parametrize("board", [CHESS, CHARUCO], ids=["chessboard", "charuco"])
def test_no_board_is_none(board):
    noise = np.random.default_rng(1).integers(0, 255, (480, 848), dtype=np.uint8)
    assert find(board, "noise", cv2.GaussianBlur(noise, (0, 0), 3)) is None


def test_the_pose_of_a_board_is_found_from_its_corners():
    turn, move = next(iter(poses(1, seed=4)))
    pixels = FISHEYE.project(turn.apply(CHESS.corners_m) + move)[0]
    found = board_pose(Sighting("one", CHESS.corners_m, pixels), FISHEYE)
    assert found is not None
    assert found[1] == pytest.approx(move, abs=1e-4)
    assert (Rotation.from_rotvec(found[0]).inv() * turn).magnitude() < 1e-3


def test_the_printed_chessboard_is_what_the_board_says():
    assert find(CHESS, "print", picture(CHESS, 30)) is not None
    assert picture(CHESS, 30).shape == (8 * 30, 11 * 30)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [((2, 5, 0.04), "at least 3x3"), ((5, 5, 0.04), "looks the same"), ((8, 5, 0.04, "charuco", 0.05), "do not fit")],
)
def test_boards_that_cannot_be_are_refused(wrong, said):
    with pytest.raises(CalibrationError, match=said):
        Board(*wrong)


def test_an_unknown_dictionary_is_refused():
    with pytest.raises(CalibrationError, match="9X9_7"):
        find(Board(8, 5, 0.04, "charuco", 0.03, "9X9_7"), "any", np.zeros((100, 100), np.uint8))


def test_of_a_video_each_place_is_taken_once_where_the_board_was_stillest():
    base = sightings(PINHOLE, 2, noise_px=0.0)
    way = [0.0, 9.0, 10.0, 10.5, 30.0, 200.0]
    choice = Choice(848)
    for at in way:
        choice.add(Sighting(f"{at}", base[0].board_m, base[0].pixels + np.array([at, 0.0])))
    choice.add(None)
    chosen = [one.name for one in choice.sightings()]
    assert chosen == ["10.5"]  # 30 and 200 came in leaps
    assert choice.shaken == 2


@pytest.mark.skipif(not REAL.exists(), reason=f"real pictures of a board are not here: {REAL}")
def test_a_real_fisheye_lens_is_found_from_twelve_of_its_pictures():
    board = Board(7, 5, 0.05)
    grey = {path.name: cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted(REAL.glob("fisheye_pose*.png"))}
    seen = [one for name, image in grey.items() if (one := find(board, name, image)) is not None]
    assert len(seen) == 12
    found = fit_lens(seen, (1920, 1208), "fisheye")
    # OpenCV's fisheye model on 38 pictures: fx 1180.1 fy 1179.2 cx 967.7 cy 601.7, 0.121 px
    assert found.rms_px < 0.14
    assert found.camera.focal_px == pytest.approx((1180.1, 1179.2), rel=5e-3)
    assert found.camera.centre_px == pytest.approx((967.7, 601.7), abs=6.0)
    assert any("of the picture only" in concern for concern in found.concerns)
