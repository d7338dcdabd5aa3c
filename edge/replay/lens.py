"""The calibrated lens as the geometry takes it. Apart from the calibration, so that the recorder loads no OpenCV."""

from __future__ import annotations

from edge.recording.calibration import Intrinsics
from pipeline.camera import CameraModel


def camera_model(intrinsics: Intrinsics) -> CameraModel:
    """Of the images that the intrinsics are for."""
    size = (intrinsics.width_px, intrinsics.height_px)
    return CameraModel(*size, intrinsics.focal_px, intrinsics.centre_px, intrinsics.model, tuple(intrinsics.distortion))
