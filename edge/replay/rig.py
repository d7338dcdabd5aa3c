"""The camera on the payload, as a recording tells it: its pose from /tf_static, its lens from the calibration in it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from edge import toml_table
from edge.recording.calibration import Calibration, CalibrationFile, load_calibration
from edge.replay.geometry import Matrix, find_pose
from edge.replay.lens import camera_model
from edge.ros.frames import BASE_LINK, CAMERA, Transform
from pipeline.grounding.views import CameraRig


def recorded_calibration(facts: dict[str, str], configured: str) -> Calibration:
    """The one in the recording's metadata; else the configured one. ConfigError for one that is broken."""
    text = facts.get("calibration_toml", "")
    if not text:
        return load_calibration(configured)
    file = toml_table.convert(toml_table.parse(text, "the recording's calibration"), CalibrationFile, "calibration")
    return Calibration(file, (), text)


def camera_rig(calibration: Calibration, recorded: Sequence[Transform], configured: str) -> CameraRig:
    """recorded: static transforms of the recording; configured: path of the calibration that stands in for them."""
    pose = find_pose(recorded, BASE_LINK, CAMERA)
    if pose is None:
        pose = find_pose(load_calibration(configured).transforms, BASE_LINK, CAMERA)
    assert pose is not None  # the nominal geometry has it
    return rig_of(calibration.file, pose)


def rig_of(file: CalibrationFile, pose: Matrix) -> CameraRig:
    """pose: (4, 4) of the optical frame in `base_link`."""
    return CameraRig(
        camera_model(file.intrinsics),
        pose[:3, :3],
        pose[:3, 3],
        file.timing.camera_late_s,
        math.radians(file.about.camera_rotation_sigma_deg),
        file.about.camera_translation_sigma_m,
        file.timing.sigma_s,
    )
