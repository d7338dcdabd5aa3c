"""The calibration that a session would carry: is it there, is it whole, and is it of these units."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from edge.calibration.units import CAMERA, LIDAR, Units, others, serial_of
from edge.config import Config, sensor_driver
from edge.errors import ConfigError
from edge.preflight.check import Check, Outcome
from edge.recording.calibration import CalibrationFile, load_calibration

SUBJECT = "calibration"


def units_of(config: Config, details: Mapping[str, Mapping[str, object]]) -> Units:
    """The serial numbers that the sensors tell now. details: by the sensor's name."""
    found = {sensor_driver(config, name): serial_of(told) for name, told in details.items() if name in config.sensors}
    return Units(found.get(LIDAR, ""), found.get(CAMERA, ""))


def check_calibration(config: Config, units: Units) -> list[Check]:
    """The nominal geometry is good enough to record with, and not to map trees from images."""
    if not config.calibration:
        advice = "calibrate before mapping trees from images: docs/calibration.md"
        return [Check(SUBJECT, Outcome.WARNING, "nominal geometry", advice)]
    path = Path(config.calibration).expanduser()
    try:
        file = load_calibration(config.calibration).file
    except ConfigError as error:
        return [Check(SUBJECT, Outcome.BAD, str(error), "correct `calibration` in the configuration, or the file")]
    checks = [
        Check(SUBJECT, Outcome.WARNING, f"{path}: {what}", "calibrate this unit, or configure the file that is its own")
        for what in others(file.about, units)
    ]
    if missing := _missing(file):
        advice = "`mapforest calibrate lens`, `board` or `scene`, and `time`: docs/calibration.md"
        checks.append(Check(SUBJECT, Outcome.WARNING, f"{path}: nominal is {', '.join(missing)}", advice))
    return checks or [Check(SUBJECT, Outcome.GOOD, f"{path}{_told(file)}")]


def _missing(file: CalibrationFile) -> list[str]:
    measured = {
        "the lens": file.intrinsics.residual_px > 0,
        "the camera's pose": bool(file.about.camera_pose_by),
        "how late the camera is": file.timing.correlation > 0,
    }
    return [what for what, done in measured.items() if not done]


def _told(file: CalibrationFile) -> str:
    about, timing = file.about, file.timing
    pose = f"{about.camera_rotation_sigma_deg:.2f} deg, {1e3 * about.camera_translation_sigma_m:.0f} mm"
    late = f"{1e3 * timing.camera_late_s:.0f} ms late to {1e3 * timing.sigma_s:.0f} ms"
    return f" of {about.date}: the camera's pose to {pose}, {late}, lens to {file.intrinsics.residual_px:.2f} px"
