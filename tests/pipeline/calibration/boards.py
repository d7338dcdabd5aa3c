"""Boards before a camera: where their corners are, and pictures of them."""

from functools import cache

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.calibration.board import Board, Sighting, picture
from pipeline.camera import CameraModel

CHESS = Board(8, 5, 0.04)
CHARUCO = Board(8, 5, 0.04, "charuco", 0.03)
PINHOLE = CameraModel(848, 480, (430.0, 433.0), (420.0, 245.0), "pinhole", (-0.11, 0.05, 0.001, -0.0005, 0.0))
FISHEYE = CameraModel(848, 480, (380.0, 381.0), (430.0, 236.0), "fisheye", (0.05, -0.02, 0.01, -0.004))


def poses(count: int, seed: int = 1, tilt_deg: float = 40.0, near_m: float = 0.3):
    """Of a board that is moved all about the picture: rotation and translation in the optical frame."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        turn = Rotation.from_euler("xyz", rng.uniform(-1, 1, 3) * [tilt_deg, tilt_deg, 30.0], degrees=True)
        away = rng.uniform(near_m, 2.2 * near_m)
        aside = rng.uniform(-1, 1, 2) * [0.95, 0.55] * away
        yield turn, np.array([*aside, away]) - turn.apply([0.14, 0.08, 0.0])


def sightings(camera: CameraModel, count: int, noise_px: float = 0.1, board: Board = CHESS, **where) -> list[Sighting]:
    """The ones in which enough of the board is in the picture (as a ChArUco board may be)."""
    rng = np.random.default_rng(2)
    found = []
    for number, (turn, move) in enumerate(poses(10 * count, **where)):
        pixels, inside = camera.project(turn.apply(board.corners_m) + move)
        if inside.all():
            noisy = pixels + rng.normal(0.0, noise_px, pixels.shape)
            found.append(Sighting(f"picture {number}", board.corners_m, noisy))
    return found[:count]


@cache
def rays(camera: CameraModel) -> np.ndarray:
    """(height * width, 3) of all pixels."""
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
    return camera.rays(np.column_stack([columns.ravel(), rows.ravel()]).astype(float))


def photograph(board: Board, camera: CameraModel, turn: Rotation, move: np.ndarray, square_px: int = 48) -> np.ndarray:
    """Grey picture (height, width): the ray of each pixel, cut with the board's plane."""
    printed = cv2.GaussianBlur(picture(board, square_px), (0, 0), 0.7)
    towards, eye = turn.inv().apply(rays(camera)), turn.inv().apply(-move)
    with np.errstate(divide="ignore", invalid="ignore"):
        hit = eye[:2] - towards[:, :2] * (eye[2] / towards[:, 2])[:, None]
    # Two squares of margin to the first corner; half a pixel, for its centre.
    at = ((hit / board.square_m + 2.0) * square_px - 0.5).astype(np.float32).reshape(camera.height_px, -1, 2)
    return cv2.remap(printed, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderValue=110)
