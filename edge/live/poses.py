"""Estimates as the messages that are recorded."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from edge.recording.messages import Covariance, GnssPose, OdometryPose, Transforms
from edge.ros.frames import BASE_LINK, EARTH, MAP, ODOM, Transform
from pipeline.estimates import GlobalPose, MapToOdom, OdometryEstimate
from pipeline.gnss.geodesy import Datum

Array = npt.NDArray[np.float64]
Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


def odometry_pose(estimate: OdometryEstimate, receive_ns: int) -> OdometryPose:
    """The velocity goes into `base_link`, as nav_msgs/Odometry has it."""
    return OdometryPose(
        estimate.stamp_ns,
        receive_ns,
        _three(estimate.position_m),
        _quaternion(estimate.rotation),
        _ros_covariance(estimate.covariance, estimate.rotation),
        _three(estimate.rotation.T @ estimate.velocity_m_s),
    )


def gnss_pose(pose: GlobalPose, receive_ns: int) -> GnssPose:
    """In `map`."""
    covariance = _ros_covariance(pose.covariance, pose.rotation)
    return GnssPose(pose.stamp_ns, receive_ns, _three(pose.position_enu_m), _quaternion(pose.rotation), covariance)


def transforms(estimate: OdometryEstimate, state: MapToOdom | None, receive_ns: int) -> Transforms:
    """odom -> base_link, and once the heading is known map -> odom, and earth -> map, which says where the datum is."""
    found = [Transform(ODOM, BASE_LINK, _three(estimate.position_m), _quaternion(estimate.rotation))]
    if state is not None and state.observable:
        half = state.yaw_rad / 2.0
        turn = (0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
        found.insert(0, Transform(MAP, ODOM, _three(state.translation_m), turn))
        if state.datum is not None:
            found.insert(0, _earth_to_map(*state.datum))
    return Transforms(estimate.stamp_ns, receive_ns, tuple(found))


def _earth_to_map(latitude_deg: float, longitude_deg: float, height_m: float) -> Transform:
    """East, north and up at the datum, in Earth-centred axes."""
    datum = Datum(latitude_deg, longitude_deg, height_m)
    return Transform(EARTH, MAP, _three(datum.origin_m), _quaternion(datum.turn))


def _ros_covariance(covariance: Array, rotation: Array) -> Covariance:
    """ROS wants the rotation about the fixed axes; ours is about the body's."""
    turn = np.eye(6)
    turn[3:, 3:] = rotation
    return tuple((turn @ covariance @ turn.T).ravel().tolist())


def _three(values: Array) -> Three:
    x, y, z = values.tolist()
    return x, y, z


def _quaternion(rotation: Array) -> Four:
    x, y, z, w = Rotation.from_matrix(rotation).as_quat().tolist()
    return x, y, z, w
