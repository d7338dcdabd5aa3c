"""How the camera turned, from features followed from picture to picture.

A walk of 1 m/s past trees moves near features as much as a turn does. Measured on simulated walks, taking the camera's
travel into account as well (epipolar constraint) made neither the rates nor the offset found from them better than the
robust weights do: 0.4 and 0.7 ms either way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from pipeline.calibration.errors import CalibrationError
from pipeline.calibration.turning import Turning
from pipeline.camera import Array, CameraModel

FEATURES = 300
LEAST_FEATURES = 30
LONGEST_S = 0.12
"""Between two pictures; over more the features are lost, and the turning is no longer one."""
_WINDOW_PX = (17, 17)


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """grey: (height, width) uint8."""

    stamp_ns: int
    grey: npt.NDArray[np.uint8]


def turning_of(pictures: Iterable[Picture], camera: CameraModel) -> Turning:
    """Rates in the optical frame, between pictures in order of time. CalibrationError when nothing can be followed."""
    rows = list(_follow(pictures, camera))
    if not rows:
        raise CalibrationError(
            "nothing in the pictures can be followed: too dark, too blurred, or less than ten a second; record in "
            "daylight, with the camera's cap off"
        )
    begin, end = (np.array([row[side] for row in rows], np.int64) for side in (0, 1))
    return Turning(begin, end, np.array([row[2] for row in rows]))


def _follow(pictures: Iterable[Picture], camera: CameraModel) -> Iterator[tuple[int, int, Array]]:
    before: Picture | None = None
    for now in pictures:
        if now.grey.shape != (camera.height_px, camera.width_px):
            raise CalibrationError(
                f"pictures of {now.grey.shape[1]}x{now.grey.shape[0]} pixels, the lens is calibrated for "
                f"{camera.width_px}x{camera.height_px}"
            )
        if before is not None and 0 < now.stamp_ns - before.stamp_ns <= LONGEST_S * 1e9:
            turn = _turn(before.grey, now.grey, camera)
            if turn is not None:
                yield before.stamp_ns, now.stamp_ns, turn / ((now.stamp_ns - before.stamp_ns) * 1e-9)
        before = now


def _turn(one: npt.NDArray[np.uint8], two: npt.NDArray[np.uint8], camera: CameraModel) -> Array | None:
    """Rotation vector (3,) of the camera between two pictures, in its own axes."""
    corners = cv2.goodFeaturesToTrack(one, FEATURES, 0.01, 12)
    if corners is None or len(corners) < LEAST_FEATURES:
        return None
    moved, found = _flow(one, two, corners)
    back, again = _flow(two, one, moved)
    kept = found & again & (np.linalg.norm((back - corners).reshape(-1, 2), axis=1) < 0.5)
    if kept.sum() < LEAST_FEATURES:
        return None
    first = camera.rays(corners.reshape(-1, 2)[kept].astype(np.float64))
    second = camera.rays(moved.reshape(-1, 2)[kept].astype(np.float64))
    return rotation_between(first, second)


def _flow(one: npt.NDArray[np.uint8], two: npt.NDArray[np.uint8], corners: Any) -> tuple[Any, npt.NDArray[np.bool_]]:
    guess = np.zeros_like(corners)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(one, two, corners, guess, winSize=_WINDOW_PX, maxLevel=3)
    return moved, np.asarray(found).ravel() == 1


def rotation_between(first: Array, second: Array) -> Array:
    """Rotation vector (3,) of a camera that saw bearings (n, 3) first and then second: second = R(turn)^T first.

    Robust least squares (Cauchy), so that far features count and near ones, which travel moves, do not.
    """
    turn = np.zeros(3)
    for _ in range(6):
        turned = first @ Rotation.from_rotvec(turn).as_matrix()
        left = np.cross(second, turned)
        weight = np.linalg.norm(left, axis=1)
        weight = 1.0 / (1.0 + (weight / max(float(np.median(weight)), 1e-6)) ** 2)
        # left = (I - second second^T) w for a small further turn w
        normal = weight.sum() * np.eye(3) - (second * weight[:, None]).T @ second
        turn = turn + np.linalg.solve(normal, (left * weight[:, None]).sum(axis=0))
    return turn
