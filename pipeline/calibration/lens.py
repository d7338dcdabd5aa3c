"""The lens from pictures of a board: OpenCV's calibrators do the fitting; here is which pictures, and how good it is.

Pictures whose residual stands out are left out and the rest is fitted again. The fit of each half of the pictures alone
says how far to trust the focal length: its own covariance would say so only if all errors were independent.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.calibration.board import Array, Sighting
from pipeline.calibration.errors import CalibrationError
from pipeline.camera import CameraModel, LensModel

LEAST_VIEWS = 6
ENOUGH_VIEWS = 15
OUTLIER = 2.5
"""A picture is left out when its residual is so many times the median of all, and above `FINE_PX`."""
FINE_PX = 0.3
GRID = (8, 5)
"""Cells of the coverage map across and down."""
LEAST_COVERAGE = 0.6
LEAST_TILT_DEG = 20.0
WORST_RMS_PX = 1.0
WORST_APART = 0.01
_FISHEYE = ("CALIB_RECOMPUTE_EXTRINSIC", "CALIB_FIX_SKEW", "CALIB_CHECK_COND")
"""Flags; OpenCV 4 has them in `cv2.fisheye`, OpenCV 5 in `cv2`, and their values differ."""
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-8)


@dataclass(frozen=True, slots=True)
class View:
    """One picture. rms_px: its residual; tilt_deg: of the board against the picture plane."""

    name: str
    rms_px: float
    tilt_deg: float
    used: bool


@dataclass(frozen=True, slots=True, eq=False)
class LensFit:
    """coverage: corners in each cell of `GRID` (down, across). focal_apart: relative, of the two halves; None: too few.

    concerns: why not to rely on it, each with what to do; empty: good.
    """

    camera: CameraModel
    rms_px: float
    views: tuple[View, ...]
    coverage: npt.NDArray[np.int64]
    focal_apart: float | None
    concerns: tuple[str, ...] = ()

    @property
    def covered(self) -> float:
        """Share of the cells in which there was a corner."""
        return float(np.mean(self.coverage > 0))


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    matrix: Array
    distortion: Array
    kept: list[int]
    rms_px: Array
    tilt_deg: Array


def fit_lens(sightings: Sequence[Sighting], size_px: tuple[int, int], model: LensModel) -> LensFit:
    """size_px: width, height. CalibrationError for too few pictures, or such that no lens explains them."""
    if len(sightings) < LEAST_VIEWS:
        raise CalibrationError(
            f"the board was found in {len(sightings)} pictures, at least {LEAST_VIEWS} are needed (and {ENOUGH_VIEWS} "
            "are better): check the number of its inner corners, and that all of it is in the picture and lit evenly"
        )
    chosen, fit = list(range(len(sightings))), None
    for _ in range(4):
        fit = _fit(sightings, chosen, size_px, model)
        limit = max(OUTLIER * float(np.median(fit.rms_px)), FINE_PX)
        good = [k for k, rms in zip(fit.kept, fit.rms_px, strict=True) if rms <= limit]
        if len(good) == len(fit.kept) or len(good) < LEAST_VIEWS:
            break
        chosen = good
    assert fit is not None
    return _judged(sightings, fit, size_px, model)


def _judged(sightings: Sequence[Sighting], fit: _Fit, size_px: tuple[int, int], model: LensModel) -> LensFit:
    camera = _camera(fit, size_px, model)
    own = dict(zip(fit.kept, zip(fit.rms_px, fit.tilt_deg, strict=True), strict=True))
    views = tuple(
        View(one.name, float(own[k][0]), float(own[k][1]), used=True) if k in own else _left_out(one, camera)
        for k, one in enumerate(sightings)
    )
    coverage = _coverage([sightings[k] for k in fit.kept], size_px)
    counts = np.array([len(sightings[k].pixels) for k in fit.kept])
    rms = float(np.sqrt(np.sum(counts * fit.rms_px**2) / counts.sum()))
    apart = _halves_apart(sightings, fit, size_px, model)
    return LensFit(camera, rms, views, coverage, apart, _concerns(fit, rms, coverage, apart))


def _concerns(fit: _Fit, rms_px: float, coverage: npt.NDArray[np.int64], apart: float | None) -> tuple[str, ...]:
    said = []
    if len(fit.kept) < ENOUGH_VIEWS:
        said.append(f"only {len(fit.kept)} pictures: {ENOUGH_VIEWS} and more average the errors of the corners")
    covered = float(np.mean(coverage > 0))
    if covered < LEAST_COVERAGE:
        said.append(
            f"the board was in {covered:.0%} of the picture only: bring it into the corners and along the edges"
        )
    if np.percentile(fit.tilt_deg, 80) < LEAST_TILT_DEG:
        said.append("the board always faced the camera: tilt it by 20 to 45 degrees, or the focal length is a guess")
    if rms_px > WORST_RMS_PX:
        said.append(f"{rms_px:.2f} px left over: is the board flat, and the model of the lens right (--model)?")
    if apart is not None and apart > WORST_APART:
        said.append(f"two halves of the pictures give focal lengths {apart:.1%} apart: take more, at more angles")
    return tuple(said)


def _fit(sightings: Sequence[Sighting], chosen: list[int], size_px: tuple[int, int], model: LensModel) -> _Fit:
    kept = list(chosen)
    while True:
        try:
            matrix, distortion, poses = _calibrate([sightings[k] for k in kept], size_px, model)
            break
        except cv2.error as error:
            bad = re.search(r"input array (\d+)", str(error))
            if bad is None or len(kept) <= LEAST_VIEWS:
                raise CalibrationError(
                    "no lens of this model explains the pictures: check the number of inner corners, and --model"
                ) from error
            kept.pop(int(bad[1]))  # a pose that OpenCV finds no start for
    camera = CameraModel(*size_px, *_parameters(matrix), model, tuple(distortion.tolist()))
    rms = np.array([_residual(sightings[k], pose, camera) for k, pose in zip(kept, poses, strict=True)])
    tilt = np.array([_tilt_deg(pose) for pose in poses])
    return _Fit(matrix, distortion, kept, rms, tilt)


def _calibrate(
    sightings: Sequence[Sighting], size_px: tuple[int, int], model: LensModel
) -> tuple[Array, Array, list[tuple[Array, Array]]]:
    # One row: the fisheye calibrator of OpenCV 5 refuses columns.
    board = [np.asarray(one.board_m, np.float32).reshape(1, -1, 3) for one in sightings]
    pixels = [np.asarray(one.pixels, np.float32).reshape(1, -1, 2) for one in sightings]
    calibrate: Any = cv2.fisheye.calibrate if model == "fisheye" else cv2.calibrateCamera
    names = _FISHEYE if model == "fisheye" else ()
    flags = sum(getattr(cv2.fisheye, name, None) or getattr(cv2, name) for name in names)
    fit = calibrate(board, pixels, size_px, np.eye(3), np.zeros(4 if names else 5), flags=flags, criteria=_CRITERIA)
    _, matrix, distortion, turns, moves = fit
    poses = [(_flat(turn), _flat(move)) for turn, move in zip(turns, moves, strict=True)]
    return np.asarray(matrix, np.float64), _flat(distortion), poses


def _flat(values: Any) -> Array:
    return np.asarray(values, np.float64).reshape(-1)


def _parameters(matrix: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    return (float(matrix[0, 0]), float(matrix[1, 1])), (float(matrix[0, 2]), float(matrix[1, 2]))


def _camera(fit: _Fit, size_px: tuple[int, int], model: LensModel) -> CameraModel:
    return CameraModel(*size_px, *_parameters(fit.matrix), model, tuple(fit.distortion.tolist()))


def _residual(one: Sighting, pose: tuple[Array, Array], camera: CameraModel) -> float:
    turn, move = pose
    rotation = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
    left = camera.project(one.board_m @ rotation.T + move)[0] - one.pixels
    return float(np.sqrt(np.mean(np.sum(left**2, axis=1))))


def _left_out(one: Sighting, camera: CameraModel) -> View:
    """With the residual that it has as well as a pose can make it."""
    pose = board_pose(one, camera)
    if pose is None:
        return View(one.name, float("nan"), 0.0, used=False)
    return View(one.name, _residual(one, pose, camera), _tilt_deg(pose), used=False)


def board_pose(one: Sighting, camera: CameraModel) -> tuple[Array, Array] | None:
    """Rotation vector and translation (3,) of the board in the optical frame; None where none can be found."""
    rays = camera.rays(one.pixels)
    if np.any(rays[:, 2] < 0.05):
        return None
    flat = rays[:, :2] / rays[:, 2:]
    there, turn, move = cv2.solvePnP(one.board_m, flat, np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_IPPE)
    if not there:
        return None
    turn, move = cv2.solvePnPRefineLM(one.board_m, flat, np.eye(3), np.zeros(4), turn, move)
    return _flat(turn), _flat(move)


def _tilt_deg(pose: tuple[Array, Array]) -> float:
    normal = np.asarray(cv2.Rodrigues(pose[0])[0])[:, 2]
    return float(np.degrees(np.arccos(np.clip(abs(normal[2]), 0.0, 1.0))))


def _coverage(sightings: Sequence[Sighting], size_px: tuple[int, int]) -> npt.NDArray[np.int64]:
    pixels = np.vstack([one.pixels for one in sightings])
    cells = np.minimum((pixels / size_px * GRID).astype(np.int64), np.array(GRID) - 1).clip(0)
    counts = np.zeros((GRID[1], GRID[0]), np.int64)
    np.add.at(counts, (cells[:, 1], cells[:, 0]), 1)
    return counts


def _halves_apart(sightings: Sequence[Sighting], fit: _Fit, size_px: tuple[int, int], model: LensModel) -> float | None:
    """None where the halves are too small to be fitted alone."""
    halves = fit.kept[::2], fit.kept[1::2]
    if min(map(len, halves)) < LEAST_VIEWS:
        return None
    try:
        one, two = (_fit(sightings, half, size_px, model).matrix[0, 0] for half in halves)
    except CalibrationError:
        return None
    return float(abs(one - two) / fit.matrix[0, 0])
