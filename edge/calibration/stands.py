"""The moments of a recording in which the payload stood still, each with a picture and what the LiDAR saw around it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from drivers.messages import LidarScan
from edge.calibration.recording import CalibrationRecording
from edge.errors import FormatError
from edge.recording.calibration import CalibrationFile, Pose
from edge.replay.frames import every
from pipeline.calibration.scene_extrinsics import Stand
from pipeline.calibration.turning import Array, Turning

STAND_S = 3.0
STEP_S = 0.5
STILL_RAD_S = 0.03
"""RMS about the mean: a person who stands sways by 1 to 2 deg/s, which is taken out; a step is ten times that."""
MOST = 8
_CLEAN = 0x0F
"""Bits of the tag that mark glued edges and particles."""


def find_stands(
    recording: CalibrationRecording, file: CalibrationFile, advance: Callable[[float], None], least_s: float = STAND_S
) -> list[Stand]:
    """The stillest, at most `MOST`, in order. FormatError where it never stood still so long, or without video."""
    gyro, late_ns = recording.gyro(), round(file.timing.camera_late_s * 1e9)
    first_ns, last_ns = recording.video_span_ns()
    middles = _still(gyro.within(first_ns - late_ns, last_ns - late_ns), least_s)
    if not middles:
        raise FormatError(
            f"{recording.name}: the payload never stood still for {least_s:g} s while the camera ran: stand still, "
            "better on the ground or a tripod, for a few seconds at a few places"
        )
    half_ns = round(least_s * 0.5e9)
    found = []
    for number, middle_ns in enumerate(middles):
        picture = _picture(recording, middle_ns + late_ns)
        scans = list(recording.scans(middle_ns - half_ns, middle_ns + half_ns))
        if picture is not None and scans:
            at_ns, image = picture
            parts = [_unswayed(scan, gyro, at_ns - late_ns, file.livox_frame, half_ns) for scan in scans]
            found.append(Stand(image, np.vstack(parts)))
        advance((number + 1) / len(middles))
    return found


def _still(gyro: Turning, least_s: float) -> list[int]:
    """Middles of the stillest windows; those that overlap are one place."""
    if not len(gyro):
        return []
    length_ns, step_ns = round(least_s * 1e9), round(STEP_S * 1e9)
    windows = []
    for begin_ns in range(int(gyro.begin_ns[0]), int(gyro.end_ns[-1]) - length_ns + 1, step_ns):
        rows = slice(*np.searchsorted(gyro.begin_ns, [begin_ns, begin_ns + length_ns]).tolist())
        rate = gyro.rate[rows]
        if len(rate) * gyro.period_s > 0.8 * least_s:
            sway = float(np.sqrt(np.mean(np.sum((rate - rate.mean(axis=0)) ** 2, axis=1))))
            windows.append((sway, begin_ns + length_ns // 2))
    chosen: list[int] = []
    for sway, middle_ns in sorted(windows):
        if sway < STILL_RAD_S and len(chosen) < MOST and all(abs(middle_ns - other) >= length_ns for other in chosen):
            chosen.append(middle_ns)
    return sorted(chosen)


def _picture(
    recording: CalibrationRecording, stamp_ns: int
) -> tuple[int, np.ndarray[tuple[int, ...], np.dtype[np.uint8]]] | None:
    """The first one stamped then or within half a second."""
    end_ns = stamp_ns + 500_000_000
    once = every(0.0)
    for at_ns, image in recording.images(lambda at_ns: stamp_ns <= at_ns < end_ns and once(at_ns)):
        return at_ns, image
    return None


def _unswayed(scan: LidarScan, gyro: Turning, at_ns: int, lidar: Pose, half_ns: int) -> Array:
    """Points (n, 3) of a sweep as from the payload's attitude at an instant."""
    clean = (scan.tag & _CLEAN) == 0
    points = scan.xyz_m[clean].astype(np.float64)
    around = gyro.within(at_ns - 2 * half_ns, at_ns + 2 * half_ns)
    bias = gyro.within(at_ns - half_ns, at_ns + half_ns).rate.mean(axis=0)  # it stood still then; before, it may not
    edges_s = (around.end_ns - at_ns) * 1e-9
    angle = np.cumsum((around.rate - bias) * ((around.end_ns - around.begin_ns) * 1e-9)[:, None], axis=0)
    times_s = (scan.stamp_ns - at_ns + scan.offset_ns[clean].astype(np.int64)) * 1e-9
    turn = np.column_stack([np.interp(times_s, edges_s, a) - np.interp(0.0, edges_s, a) for a in angle.T])
    mounting, lever = Rotation.from_quat(lidar.rotation_xyzw), np.array(lidar.translation_m)
    base = Rotation.from_rotvec(turn).apply(mounting.apply(points) + lever)
    return np.asarray(mounting.inv().apply(base - lever))
