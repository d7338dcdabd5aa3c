"""The camera's pose as the file has it (in `base_link`) and as calibration finds it (from the LiDAR)."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from edge.calibration.file import today, with_units
from edge.calibration.units import Units
from edge.recording.calibration import CalibrationFile, Pose
from pipeline.calibration.extrinsics import Extrinsics, Found


def extrinsics_of(file: CalibrationFile) -> Extrinsics:
    """From `livox_frame` to the optical frame."""
    camera, lidar = _matrix(file.camera), _matrix(file.livox_frame)
    found = np.linalg.inv(camera) @ lidar
    return Extrinsics(found[:3, :3], found[:3, 3])


def with_camera(
    file: CalibrationFile, found: Found, by: Literal["board", "scene"], residual: float, units: Units
) -> CalibrationFile:
    """The file with the camera where it was found, and how sure that is."""
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = found.extrinsics.rotation.T, found.extrinsics.camera_m
    base = _matrix(file.livox_frame) @ inverse
    x, y, z = (round(float(value), 5) for value in base[:3, 3])
    qx, qy, qz, qw = (round(float(value), 7) for value in Rotation.from_matrix(base[:3, :3]).as_quat())
    return with_units(
        msgspec.structs.replace(file, camera=Pose((x, y, z), (qx, qy, qz, qw))),
        units,
        camera_rotation_sigma_deg=round(found.rotation_sigma_deg, 4),
        camera_translation_sigma_m=round(found.translation_sigma_m, 5),
        camera_pose_by=by,
        camera_pose_residual=round(residual, 5),
        camera_pose_date=today(),
    )


def apart(found: Extrinsics, guess: Extrinsics) -> tuple[float, float]:
    """How far the camera is from where it was thought to be: degrees, metres."""
    turn = Rotation.from_matrix(found.rotation @ guess.rotation.T)
    return float(np.degrees(turn.magnitude())), float(np.linalg.norm(found.camera_m - guess.camera_m))


def _matrix(pose: Pose) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = Rotation.from_quat(pose.rotation_xyzw).as_matrix(), pose.translation_m
    return made
