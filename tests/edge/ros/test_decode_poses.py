"""Poses that `rosbags` encodes are read, and what our encoders write comes back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from edge.errors import FormatError
from edge.recording.messages import GnssPose, OdometryPose
from edge.ros import encode, schemas
from edge.ros.decode_poses import decode_odometry, decode_pose

STORE = get_typestore(Stores.ROS2_HUMBLE)
T = STORE.types
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def of(count: int):
    return st.tuples(*[NUMBERS] * count)


def header(stamp_ns: int, frame: str):
    time = T["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return T["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def vector(values):
    return T["geometry_msgs/msg/Vector3"](**dict(zip("xyz", values, strict=True)))


def pose(position, rotation, covariance):
    at = T["geometry_msgs/msg/Point"](**dict(zip("xyz", position, strict=True)))
    turn = T["geometry_msgs/msg/Quaternion"](**dict(zip("xyzw", rotation, strict=True)))
    plain = T["geometry_msgs/msg/Pose"](position=at, orientation=turn)
    return T["geometry_msgs/msg/PoseWithCovariance"](pose=plain, covariance=np.array(covariance))


@given(st.integers(0, 2**31 * 10**9 - 1), st.text("odmap_/é", max_size=9), of(3), of(4), of(36))
def test_a_pose_of_rosbags_is_read(stamp, frame, position, rotation, covariance):
    message = T[schemas.POSE](header=header(stamp, frame), pose=pose(position, rotation, covariance))
    read = decode_pose(bytes(STORE.serialize_cdr(message, schemas.POSE)))
    assert (read.stamp_ns, read.frame_id) == (stamp, frame)
    assert (read.position_m, read.rotation_xyzw, read.covariance) == (position, rotation, covariance)


@given(st.text("odmap_/é", max_size=9), st.text("base_link", max_size=9), of(7), of(36), of(42))
def test_an_odometry_of_rosbags_is_read(frame, child, place, covariance, twist):
    plain = T["geometry_msgs/msg/Twist"](linear=vector(twist[:3]), angular=vector(twist[3:6]))
    velocity = T["geometry_msgs/msg/TwistWithCovariance"](twist=plain, covariance=np.array(twist[6:]))
    where = pose(place[:3], place[3:], covariance)
    message = T[schemas.ODOMETRY](header=header(5, frame), child_frame_id=child, pose=where, twist=velocity)
    read = decode_odometry(bytes(STORE.serialize_cdr(message, schemas.ODOMETRY, little_endian=False)))
    assert (read.pose.stamp_ns, read.pose.frame_id, read.child_frame_id) == (5, frame, child)
    assert (*read.pose.position_m, *read.pose.rotation_xyzw) == place
    assert read.pose.covariance == covariance
    assert (*read.linear, *read.angular, *read.twist_covariance) == twist


@given(of(3), of(4), of(36), of(3))
def test_what_our_encoders_write_comes_back(position, rotation, covariance, velocity):
    read = decode_odometry(encode.encode_odometry(OdometryPose(1, 2, position, rotation, covariance, velocity), 7))
    assert (read.pose.stamp_ns, read.pose.frame_id, read.child_frame_id) == (7, "odom", "base_link")
    assert (read.pose.position_m, read.pose.rotation_xyzw, read.pose.covariance) == (position, rotation, covariance)
    assert (read.linear, read.angular) == (velocity, (0.0, 0.0, 0.0))
    back = decode_pose(encode.encode_pose(GnssPose(1, 2, position, rotation, covariance), 8))
    assert (back.stamp_ns, back.frame_id, back.covariance) == (8, "map", covariance)


def test_a_pose_cut_short_is_refused():
    whole = encode.encode_pose(GnssPose(1, 2, (0.0,) * 3, (0.0,) * 4, (0.0,) * 36), 8)
    with pytest.raises(FormatError, match="ends early"):
        decode_pose(whole[:-1])
