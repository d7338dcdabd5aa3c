"""How late the camera's stamps are, from a recording of the moving payload."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from edge.calibration.file import today, with_units
from edge.calibration.recording import CalibrationRecording
from edge.recording.calibration import CalibrationFile, Timing
from edge.replay.lens import camera_model
from pipeline.calibration.image_turning import Picture, turning_of
from pipeline.calibration.offset import TimeOffset, find_offset
from pipeline.camera import CameraModel

MOST_LATE_S = 2.0
TURNED_WRONG_DEG = 5.0
"""The rotation that comes along is good to half a degree in simulation; the calibrated one cannot be so far off."""
_WIDTH_PX = 848


class TimeReport(msgspec.Struct, frozen=True):
    """camera_late_s: the stamps are later than the exposure by so much; refusal: why that cannot be told.

    mounted_off_deg: between the rotation of the camera in the file and the one seen here in passing.
    """

    session: str
    camera_late_s: float
    sigma_s: float
    correlation: float
    rival: float
    drift_ppm: float
    turning_deg_s: float
    stretches: int
    frames: int
    mounted_off_deg: float
    refusal: str = ""
    warning: str = ""


def measure(
    recording: CalibrationRecording, file: CalibrationFile, advance: Callable[[float], None], most_s: float = 60.0
) -> TimeReport:
    """Looks at `most_s` seconds of video at most. FormatError or CalibrationError when there is nothing to look at."""
    camera = camera_model(file.intrinsics)
    first_ns, last_ns = recording.video_span_ns()
    until_ns = min(last_ns, first_ns + round(most_s * 1e9))

    def wanted(stamp_ns: int) -> bool:
        advance(min((stamp_ns - first_ns) / max(until_ns - first_ns, 1), 1.0))
        return stamp_ns <= until_ns

    turning = turning_of((_fitting(picture, camera) for picture in recording.pictures(wanted)), _small(camera))
    found = find_offset(turning, recording.gyro(), -MOST_LATE_S, MOST_LATE_S)
    return _report(recording.name, found, len(turning), file)


def completed(file: CalibrationFile, report: TimeReport, recording: CalibrationRecording) -> CalibrationFile:
    """The file with what was found."""
    timing = Timing(round(report.camera_late_s, 5), round(report.sigma_s, 5), round(report.correlation, 4), today())
    return with_units(msgspec.structs.replace(file, timing=timing), recording.units())


def _report(session: str, found: TimeOffset, frames: int, file: CalibrationFile) -> TimeReport:
    # find_offset: camera axes from those of `base_link`; the file has the pose of the camera in `base_link`.
    off = Rotation.from_quat(file.camera.rotation_xyzw).inv() * Rotation.from_matrix(found.rotation).inv()
    off_deg = float(np.degrees(off.magnitude()))
    warning = ""
    if not found.refusal and off_deg > TURNED_WRONG_DEG:
        warning = f"the camera turned as if mounted {off_deg:.0f} degrees from what the file says: measure it again"
    return TimeReport(
        session=session,
        camera_late_s=-found.later_s,
        sigma_s=found.sigma_s if np.isfinite(found.sigma_s) else -1.0,
        correlation=found.correlation,
        rival=found.rival,
        drift_ppm=1e6 * found.drift,
        turning_deg_s=float(np.degrees(found.turning_rad_s)),
        stretches=found.stretches,
        frames=frames,
        mounted_off_deg=off_deg,
        refusal=found.refusal,
        warning=warning,
    )


def _small(camera: CameraModel) -> CameraModel:
    """Large pictures are looked at in small: turning needs no detail, and tracking costs by the pixel."""
    if camera.width_px <= _WIDTH_PX:
        return camera
    return camera.resized(_WIDTH_PX, round(camera.height_px * _WIDTH_PX / camera.width_px))


def _fitting(picture: Picture, camera: CameraModel) -> Picture:
    small = _small(camera)
    if small is camera or picture.grey.shape != (camera.height_px, camera.width_px):
        return picture
    size = (small.width_px, small.height_px)
    return replace(picture, grey=np.asarray(cv2.resize(picture.grey, size, interpolation=cv2.INTER_AREA), np.uint8))
