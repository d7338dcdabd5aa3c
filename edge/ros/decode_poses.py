"""Poses with their uncertainty, from CDR.

Covariances as ROS has them: 36 values, row by row, x, y, z (m), then rotation (rad) about the fixed axes of the frame
that the pose is in, not about the body's.
"""

from __future__ import annotations

from dataclasses import dataclass

from edge.ros.cdr import CdrReader


@dataclass(frozen=True, slots=True)
class Pose:
    """geometry_msgs/PoseWithCovarianceStamped, in `frame_id`."""

    stamp_ns: int
    frame_id: str
    position_m: tuple[float, ...]
    rotation_xyzw: tuple[float, ...]
    covariance: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Odometry:
    """nav_msgs/Odometry: the pose of `child_frame_id`, and its velocities in its own axes, m/s and rad/s."""

    pose: Pose
    child_frame_id: str
    linear: tuple[float, ...]
    angular: tuple[float, ...]
    twist_covariance: tuple[float, ...]


def decode_pose(data: bytes | memoryview) -> Pose:
    """geometry_msgs/PoseWithCovarianceStamped."""
    reader = CdrReader(data)
    return _pose(reader, *reader.header())


def decode_odometry(data: bytes | memoryview) -> Odometry:
    """nav_msgs/Odometry."""
    reader = CdrReader(data)
    stamp_ns, frame_id = reader.header()
    child_frame_id = reader.string()
    pose = _pose(reader, stamp_ns, frame_id)
    twist = reader.unpack("d", 42)
    return Odometry(pose, child_frame_id, twist[:3], twist[3:6], twist[6:])


def _pose(reader: CdrReader, stamp_ns: int, frame_id: str) -> Pose:
    values = reader.unpack("d", 43)
    return Pose(stamp_ns, frame_id, values[:3], values[3:7], values[7:])
