"""Where the sensors sit on the payload: the nominal geometry, or the calibration file.

The file has a table for each frame that differs from nominal:

    [camera]
    translation_m = [0.06, 0.0, -0.07]
    rotation_xyzw = [-0.5, 0.5, -0.5, 0.5]

Each is the pose of that frame in `base_link`, which is the IMU (x forward, y left, z up). `[intrinsics]` is the lens,
`[timing]` how late the camera's stamps are, `[about]` whose they are and how well they were found.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from edge import toml_table
from edge.errors import ConfigError
from edge.ros.frames import BASE_LINK, CAMERA, GNSS_ANTENNA, LIDAR, Transform


class Pose(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Pose in `base_link`."""

    translation_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation_xyzw: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


class Frames(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Poses of all sensors in `base_link`; the defaults are the nominal payload.

    Mid-360: the point origin is at (-0.011, -0.02329, 0.04412) m of the IMU by the maker's manual. Camera: optical
    frame (x right, y down, z forward) ahead of and below the LiDAR. Antenna: on top.
    """

    livox_frame: Pose = Pose((-0.011, -0.02329, 0.04412))
    camera: Pose = Pose((0.06, 0.0, -0.07), (-0.5, 0.5, -0.5, 0.5))
    gnss_antenna: Pose = Pose((-0.05, 0.0, 0.20))


class Intrinsics(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Of one lens mode; the default is the nominal linear lens of the preview stream, 89 degrees across."""

    width_px: int = 848
    height_px: int = 480
    focal_px: tuple[float, float] = (432.0, 432.0)
    centre_px: tuple[float, float] = (423.5, 239.5)
    model: Literal["pinhole", "fisheye"] = "pinhole"
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    residual_px: float = 0.0
    """RMS of the calibration; 0: nominal."""
    date: str = ""


class Timing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """camera_late_s: by so much the camera's stamps are later than the exposure they stand for.

    correlation: of the turning of camera and IMU there, 0..1; 0: not measured.
    """

    camera_late_s: float = 0.0
    sigma_s: float = 0.02
    correlation: float = 0.0
    date: str = ""


class About(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which unit, when, and how sure. Serial numbers as the sensors tell them; empty: not known.

    date: of the last change. camera_pose_by: "board" or "scene"; empty: measured by hand. camera_pose_residual: RMS of
    that, metres off the board's plane; 0: there is none.
    """

    date: str = ""
    lidar_serial: str = ""
    camera_serial: str = ""
    camera_lens: str = ""
    camera_rotation_sigma_deg: float = 1.0
    camera_translation_sigma_m: float = 0.02
    camera_pose_by: Literal["", "board", "scene"] = ""
    camera_pose_residual: float = 0.0
    camera_pose_date: str = ""
    notes: str = ""


class CalibrationFile(Frames, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    intrinsics: Intrinsics = Intrinsics()
    timing: Timing = Timing()
    about: About = About()


@dataclass(frozen=True, slots=True)
class Calibration:
    """What the file says, the static transforms in it, and its text (empty: nominal)."""

    file: CalibrationFile
    transforms: tuple[Transform, ...]
    text: str


def load_calibration(path: str) -> Calibration:
    """Read the calibration file; the nominal geometry when `path` is empty. ConfigError for a file that is wrong."""
    if not path:
        return Calibration(CalibrationFile(), _transforms(Frames()), "")
    file = Path(path).expanduser()
    if not file.exists():
        raise ConfigError(
            f"calibration: {file}: no such file; correct the key, or leave it empty for the nominal geometry"
        )
    found = toml_table.convert(toml_table.read(file), CalibrationFile, str(file))
    for name in Frames.__struct_fields__:
        pose: Pose = getattr(found, name)
        norm = sum(value * value for value in pose.rotation_xyzw)
        if abs(norm - 1) > 1e-3:
            raise ConfigError(f"{file}: {name}.rotation_xyzw: length {norm**0.5:.4f}, a unit quaternion is expected")
    return Calibration(found, _transforms(found), file.read_text())


def _transforms(frames: Frames) -> tuple[Transform, ...]:
    poses = ((LIDAR, frames.livox_frame), (CAMERA, frames.camera), (GNSS_ANTENNA, frames.gnss_antenna))
    return tuple(Transform(BASE_LINK, name, pose.translation_m, pose.rotation_xyzw) for name, pose in poses)
