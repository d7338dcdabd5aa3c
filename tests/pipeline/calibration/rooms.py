"""What a LiDAR with the Mid-360's field of view sees of a board in a room."""

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.calibration.board import Board, Sighting
from pipeline.calibration.board_extrinsics import Hold
from pipeline.calibration.extrinsics import Extrinsics
from pipeline.camera import CameraModel

LOOKING = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Optical from a frame with x forward and z up."""
TRUE = Extrinsics(LOOKING, np.array([-0.02, -0.11, -0.07])).moved(np.array([0.02, -0.03, 0.015, 0, 0, 0]))
BOARD = Board(8, 5, 0.08)


def guess(seed: int, degrees: float = 3.0, metres: float = 0.04) -> Extrinsics:
    """The true extrinsics, measured badly."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    turn = np.radians(degrees) * axis / np.linalg.norm(axis)
    return TRUE.moved(np.r_[turn, rng.uniform(-metres, metres, 3)])


def holds(camera: CameraModel, count: int, seed: int = 1, tilt_deg: float = 35.0, noise_m: float = 0.012) -> list[Hold]:
    """The board at `count` places where camera and LiDAR both see all of it."""
    rng = np.random.default_rng(seed)
    found: list[Hold] = []
    while len(found) < count:
        turn = Rotation.from_euler("xyz", rng.uniform(-1, 1, 3) * [tilt_deg, tilt_deg, 25.0], degrees=True)
        away = rng.uniform(1.2, 2.5)
        move = np.array([rng.uniform(-0.6, 0.6) * away, rng.uniform(-0.35, -0.1) * away, away])
        move = move - turn.apply([0.28, 0.16, 0.0])
        pixels, inside = camera.project(turn.apply(BOARD.corners_m) + move)
        if inside.all():
            noisy = pixels + rng.normal(0.0, 0.15, pixels.shape)
            sighting = Sighting(f"pose {len(found)}", BOARD.corners_m, noisy)
            found.append(Hold(sighting, points(turn.as_matrix(), move, rng, noise_m)))
    return found


def points(turn: np.ndarray, move: np.ndarray, rng: np.random.Generator, noise_m: float) -> np.ndarray:
    """In `livox_frame`: the board (pose in the optical frame), a wall behind, the ground, and a hand that holds it."""
    azimuth = rng.uniform(-1.0, 1.0, 40_000)
    elevation = rng.uniform(np.radians(-7.0), np.radians(52.0), 40_000)
    level = np.cos(elevation)
    towards = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    distance = np.minimum(4.0 / towards[:, 0], np.where(towards[:, 2] < 0, -1.2 / towards[:, 2], np.inf))
    in_lidar = TRUE.rotation.T @ turn, TRUE.rotation.T @ (move - TRUE.translation_m)
    normal = in_lidar[0][:, 2]
    reach = (normal @ in_lidar[1]) / (towards @ normal)
    on_board = (towards * reach[:, None] - in_lidar[1]) @ in_lidar[0]
    low, high = BOARD.outline_m.min(axis=0), BOARD.outline_m.max(axis=0)
    hit = np.all((on_board[:, :2] > low) & (on_board[:, :2] < high), axis=1) & (reach > 0) & (reach < distance)
    distance = np.where(hit, reach, distance) + rng.normal(0.0, noise_m, len(distance))
    hand = in_lidar[1] + in_lidar[0] @ [0.28, 0.45, 0.05] + rng.normal(0.0, 0.04, (200, 3))
    return np.vstack([towards * distance[:, None], hand])
