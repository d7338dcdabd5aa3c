"""Definitions of the ROS 2 types a recording holds, as concatenated `ros2msg` text (files in `definitions/`)."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
IMU = "sensor_msgs/msg/Imu"
NAV_SAT_FIX = "sensor_msgs/msg/NavSatFix"
SENTENCE = "nmea_msgs/msg/Sentence"
COMPRESSED_VIDEO = "foxglove_msgs/msg/CompressedVideo"
DIAGNOSTIC_ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
LOG = "rcl_interfaces/msg/Log"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
DETECTIONS = "vision_msgs/msg/Detection2DArray"
TF_MESSAGE = "tf2_msgs/msg/TFMessage"


@cache
def schema_text(type_name: str) -> bytes:
    """The definition of a type such as `sensor_msgs/msg/Imu`, with everything it is made of."""
    package, _, name = type_name.partition("/msg/")
    return files("edge.ros").joinpath("definitions", package, f"{name}.msg").read_bytes()
