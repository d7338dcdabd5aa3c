"""Where the camera was when an image was exposed, and how well that is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from pipeline.camera import CameraModel

Array = npt.NDArray[np.float64]
SAME_SHAPE = 0.01
FARTHEST_APART_NS = 300_000_000
"""Between two poses farther apart than this nothing is interpolated."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraRig:
    """The camera on the payload. rotation (3, 3), position_m (3,): optical frame in `base_link`.

    late_s: by so much its stamps are later than the exposure.
    """

    model: CameraModel
    rotation: Array
    position_m: Array
    late_s: float = 0.0
    rotation_sigma_rad: float = 0.0175
    position_sigma_m: float = 0.02
    time_sigma_s: float = 0.02

    def for_images(self, width_px: int, height_px: int) -> CameraRig | None:
        """The same for images of another size; None for another shape, which is another lens mode."""
        model = self.model
        if abs(width_px * model.height_px / (height_px * model.width_px) - 1.0) > SAME_SHAPE:
            return None
        return replace(self, model=model.resized(width_px, height_px))


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """rotation (3, 3), position_m (3,): optical frame in the frame of the poses.

    bearing_sigma_rad, position_sigma_m: what is another error in each view, by the time of the exposure.
    lasting_rad, lasting_m: what is the same in all of them, by the calibration.
    """

    stamp_ns: int
    model: CameraModel
    rotation: Array
    position_m: Array
    bearing_sigma_rad: float = 0.0
    position_sigma_m: float = 0.0
    lasting_rad: float = 0.0
    lasting_m: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Of `base_link`: rotation (3, 3), position_m (3,)."""

    stamp_ns: int
    rotation: Array
    position_m: Array


def camera_view(stamp_ns: int, before: Pose, after: Pose, rig: CameraRig) -> CameraView | None:
    """The view of an image with a stamp, between two poses around its exposure; None when they are too far apart.

    A body that turns is not where a straight line between poses says by an eighth of the change of its rate times the
    square of the time between: 0.1 degrees at 10 Hz for a walker; it stays within what the calibration leaves open.
    """
    exposed_ns = stamp_ns - round(rig.late_s * 1e9)
    apart_ns = after.stamp_ns - before.stamp_ns
    if not before.stamp_ns <= exposed_ns <= after.stamp_ns or not 0 < apart_ns <= FARTHEST_APART_NS:
        return None
    share = (exposed_ns - before.stamp_ns) / apart_ns
    turn = Rotation.from_matrix(before.rotation.T @ after.rotation).as_rotvec()
    body = before.rotation @ Rotation.from_rotvec(share * turn).as_matrix()
    place = before.position_m + share * (after.position_m - before.position_m)
    rate_rad_s = float(np.linalg.norm(turn)) / (apart_ns * 1e-9)
    speed_m_s = float(np.linalg.norm(after.position_m - before.position_m)) / (apart_ns * 1e-9)
    return CameraView(
        stamp_ns,
        rig.model,
        body @ rig.rotation,
        place + body @ rig.position_m,
        rate_rad_s * rig.time_sigma_s,
        speed_m_s * rig.time_sigma_s,
        rig.rotation_sigma_rad,
        rig.position_sigma_m,
    )
