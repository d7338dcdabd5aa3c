"""Where the camera sits, from a recording in which the payload stands still among trees; no target."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np

from edge.calibration.frames import apart, extrinsics_of, with_camera
from edge.calibration.overlay import overlay
from edge.calibration.recording import CalibrationRecording
from edge.calibration.stands import find_stands
from edge.recording.calibration import CalibrationFile
from edge.replay.lens import camera_model
from pipeline.calibration.board import Image
from pipeline.calibration.scene_extrinsics import SceneFound, from_scene


class SceneReport(msgspec.Struct, frozen=True):
    """Sigmas: about the axis and in the direction that is known least. moved: from what the file said."""

    session: str
    stands: int
    edges: int
    standout: float
    agreed: float
    rotation_sigma_deg: float
    translation_sigma_m: float
    moved_deg: float
    moved_m: float
    refusal: str


def measure(
    recording: CalibrationRecording, file: CalibrationFile, least_s: float, advance: Callable[[float], None]
) -> tuple[SceneFound, SceneReport, Image]:
    """And the overlay of the first places. The file's pose is the guess. CalibrationError for too little to see."""
    guess, camera = extrinsics_of(file), camera_model(file.intrinsics)
    stands = find_stands(recording, file, lambda share: advance(0.3 * share), least_s)
    found = from_scene(stands, camera, guess, lambda share: advance(0.3 + 0.7 * share))
    moved_deg, moved_m = apart(found.extrinsics, guess)
    report = SceneReport(
        session=recording.name,
        stands=len(stands),
        edges=found.edges,
        standout=found.standout,
        agreed=found.agreed,
        rotation_sigma_deg=found.rotation_sigma_deg,
        translation_sigma_m=found.translation_sigma_m,
        moved_deg=moved_deg,
        moved_m=moved_m,
        refusal=found.refusal,
    )
    rows = [
        np.hstack([overlay(stand.image_bgr, stand.points_m, pose, camera) for pose in (guess, found.extrinsics)])
        for stand in stands[:3]
    ]
    return found, report, np.asarray(np.vstack(rows), np.uint8)


def completed(file: CalibrationFile, found: SceneFound, recording: CalibrationRecording) -> CalibrationFile:
    """The file with what was found."""
    return with_camera(file, found, "scene", 0.0, recording.units())
