"""Where LiDAR and antenna sit on the IMU: from the recording's static transforms, else as configured."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from edge.ros.frames import BASE_LINK, GNSS_ANTENNA, LIDAR, Transform

Matrix = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Geometry:
    """Poses in the frame of the IMU, (4, 4) each. notes: what had to be assumed."""

    lidar: Matrix
    antenna: Matrix
    notes: tuple[str, ...] = ()


def find_geometry(
    recorded: Iterable[Transform], usual: Sequence[Transform], imu_frame: str, lidar_frame: str, *, livox: bool
) -> Geometry:
    """recorded: from /tf_static. usual: of the configured payload. livox: the cloud is a Livox', whose driver tells
    no transform; its IMU is inside, at the nominal place."""
    tree = _Tree(recorded)
    nominal = {transform.child: _matrix(transform) for transform in usual if transform.parent == BASE_LINK}
    notes = []
    lidar = tree.pose(imu_frame, lidar_frame) if imu_frame != lidar_frame else None
    if lidar is None and (livox or lidar_frame == LIDAR):
        lidar = nominal[LIDAR]
        if imu_frame != BASE_LINK:
            notes.append("pose of the LiDAR on the IMU: taken as a Mid-360's, the recording does not tell it")
    if lidar is None:
        lidar = np.eye(4)
        notes.append(
            f"pose of the LiDAR ({lidar_frame!r}) on the IMU ({imu_frame!r}): not in the recording's /tf_static, taken "
            "as the same place and axes; give it with --lidar-pose x,y,z,qx,qy,qz,qw"
        )
    antenna = tree.pose(imu_frame, GNSS_ANTENNA)
    return Geometry(lidar, nominal[GNSS_ANTENNA] if antenna is None else antenna, tuple(notes))


def find_pose(transforms: Iterable[Transform], frame: str, of: str) -> Matrix | None:
    """Pose (4, 4) of one frame in another, None where no way leads there."""
    return _Tree(transforms).pose(frame, of)


class _Tree:
    """Transforms as edges that can be walked both ways."""

    def __init__(self, transforms: Iterable[Transform]) -> None:
        self._edges: dict[str, dict[str, Matrix]] = {}
        for transform in transforms:
            matrix = _matrix(transform)
            self._edges.setdefault(transform.parent, {})[transform.child] = matrix
            self._edges.setdefault(transform.child, {})[transform.parent] = np.linalg.inv(matrix).astype(np.float64)

    def pose(self, frame: str, of: str) -> Matrix | None:
        """Pose of one frame in another, None where no way leads there."""
        found = {frame: np.eye(4)}
        waiting = [frame]
        while waiting:
            here = waiting.pop()
            if here == of:
                return found[here]
            for there, matrix in self._edges.get(here, {}).items():
                if there not in found:
                    found[there] = found[here] @ matrix
                    waiting.append(there)
        return None


def _matrix(transform: Transform) -> Matrix:
    return pose_matrix(transform.translation_m, transform.rotation_xyzw)


def pose_matrix(translation_m: Sequence[float], rotation_xyzw: Sequence[float]) -> Matrix:
    """(4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(rotation_xyzw).as_matrix()
    matrix[:3, 3] = translation_m
    return matrix
