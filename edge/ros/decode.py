"""CDR back to Python, also for recordings made by others. Stamps are nanoseconds as written; FormatError for bytes
that are not the message they should be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from edge.errors import FormatError
from edge.ros import schemas
from edge.ros.cdr import CdrReader
from edge.ros.decode_detections import decode_detections
from edge.ros.decode_poses import decode_odometry, decode_pose
from edge.ros.frames import Transform

CUSTOM_POINT = np.dtype(
    {
        "names": ["offset_time", "x", "y", "z", "reflectivity", "tag", "line"],
        "formats": ["u4", "f4", "f4", "f4", "u1", "u1", "u1"],
        "itemsize": 20,
    }
)
"""19 bytes, and one of alignment that the last point of a message lacks."""
_NUMPY_CODE = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


@dataclass(frozen=True, slots=True)
class PointCloud:
    """sensor_msgs/PointCloud2. points: (height * width,) structured array with the message's own field names."""

    stamp_ns: int
    frame_id: str
    height: int
    width: int
    is_dense: bool
    points: npt.NDArray[np.void]


@dataclass(frozen=True, slots=True)
class CustomCloud:
    """livox_ros_driver2/CustomMsg. points: (n,) of CUSTOM_POINT; offset_time counts from timebase_ns."""

    stamp_ns: int
    frame_id: str
    timebase_ns: int
    points: npt.NDArray[np.void]


@dataclass(frozen=True, slots=True)
class Imu:
    """sensor_msgs/Imu. rad/s and m/s^2 by REP-103 (some drivers write g)."""

    stamp_ns: int
    frame_id: str
    orientation_xyzw: tuple[float, ...]
    orientation_covariance: tuple[float, ...]
    angular_velocity: tuple[float, ...]
    linear_acceleration: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class NavSatFix:
    """sensor_msgs/NavSatFix. covariance: 9 values, row-major ENU, m^2. status: -1 none, 0 fix, 1 SBAS, 2 GBAS."""

    stamp_ns: int
    frame_id: str
    status: int
    service: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    covariance: tuple[float, ...]
    covariance_type: int


@dataclass(frozen=True, slots=True)
class Sentence:
    """nmea_msgs/Sentence."""

    stamp_ns: int
    frame_id: str
    sentence: str


@dataclass(frozen=True, slots=True)
class CompressedVideo:
    """foxglove_msgs/CompressedVideo."""

    stamp_ns: int
    frame_id: str
    data: bytes
    format: str


@dataclass(frozen=True, slots=True)
class Log:
    """rcl_interfaces/Log. level: 10 debug, 20 info, 30 warning, 40 error, 50 fatal."""

    stamp_ns: int
    level: int
    name: str
    text: str
    file: str
    function: str
    line: int


@dataclass(frozen=True, slots=True)
class Status:
    """diagnostic_msgs/DiagnosticStatus. level: 0 ok, 1 warning, 2 error, 3 stale."""

    level: int
    name: str
    message: str
    hardware_id: str
    values: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class DiagnosticArray:
    """diagnostic_msgs/DiagnosticArray."""

    stamp_ns: int
    frame_id: str
    statuses: tuple[Status, ...]


def decode_point_cloud(data: bytes | memoryview) -> PointCloud:
    """sensor_msgs/PointCloud2 with any fields; the points are a view into `data` where rows are contiguous."""
    reader = CdrReader(data)
    stamp_ns, frame_id = reader.header()
    height, width = reader.integer("I"), reader.integer("I")
    fields = [
        (reader.string(), reader.integer("I"), reader.integer("B"), reader.integer("I"))
        for _ in range(reader.length(13))
    ]
    order = ">" if reader.boolean() else "<"
    point_step, row_step = reader.integer("I"), reader.integer("I")
    octets = reader.octets()
    is_dense = reader.boolean()
    fits = height * row_step <= len(octets) and width * point_step <= row_step
    if not fits or (point_step == 0 and height * width):
        raise FormatError(f"point cloud of {height} x {width} points does not fit into its {len(octets)} bytes")
    dtype = _point_dtype(fields, order, point_step)
    points = _points(octets, dtype, height, width, row_step)
    return PointCloud(stamp_ns, frame_id, height, width, is_dense, points)


def _point_dtype(fields: list[tuple[str, int, int, int]], order: str, point_step: int) -> np.dtype[np.void]:
    try:
        return np.dtype(
            {
                "names": [name for name, _, _, _ in fields],
                "formats": [
                    order + _NUMPY_CODE[datatype] if count == 1 else (order + _NUMPY_CODE[datatype], (count,))
                    for _, _, datatype, count in fields
                ],
                "offsets": [offset for _, offset, _, _ in fields],
                "itemsize": point_step,
            }
        )
    except (KeyError, ValueError, TypeError) as error:
        raise FormatError(f"point cloud with fields that make no sense: {fields} in {point_step} bytes") from error


def _points(
    octets: memoryview, dtype: np.dtype[np.void], height: int, width: int, row_step: int
) -> npt.NDArray[np.void]:
    if height == 0 or width == 0:
        return np.empty(0, dtype)
    if row_step == width * dtype.itemsize:
        return np.frombuffer(octets, dtype, height * width)
    rows = [np.frombuffer(octets, dtype, width, row * row_step) for row in range(height)]
    return np.concatenate(rows)


def decode_custom_cloud(data: bytes | memoryview) -> CustomCloud:
    """livox_ros_driver2/CustomMsg, also of livox_ros_driver and livox_interfaces; the points are a copy."""
    reader = CdrReader(data)
    stamp_ns, frame_id = reader.header()
    timebase_ns, _ = reader.integer("Q"), reader.integer("I")
    for _ in range(4):  # lidar_id, rsvd[3]
        reader.integer("B")
    octets, count = reader.structures(CUSTOM_POINT.itemsize, 1)
    dtype = CUSTOM_POINT.newbyteorder(reader.byte_order)
    points = np.frombuffer(bytes(octets) + b"\x00", dtype, count) if count else np.empty(0, dtype)
    return CustomCloud(stamp_ns, frame_id, timebase_ns, points)


def decode_imu(data: bytes | memoryview) -> Imu:
    """sensor_msgs/Imu."""
    reader = CdrReader(data)
    stamp_ns, frame_id = reader.header()
    values = reader.unpack("d", 37)
    return Imu(stamp_ns, frame_id, values[:4], values[4:13], values[13:16], values[25:28])


def decode_fix(data: bytes | memoryview) -> NavSatFix:
    """sensor_msgs/NavSatFix."""
    reader = CdrReader(data)
    stamp_ns, frame_id = reader.header()
    status, service = reader.integer("b"), reader.integer("H")
    latitude, longitude, altitude, *covariance = reader.unpack("d", 12)
    kind = reader.integer("B")
    return NavSatFix(stamp_ns, frame_id, status, service, latitude, longitude, altitude, tuple(covariance), kind)


def decode_sentence(data: bytes | memoryview) -> Sentence:
    """nmea_msgs/Sentence."""
    reader = CdrReader(data)
    stamp_ns, frame_id = reader.header()
    return Sentence(stamp_ns, frame_id, reader.string())


def decode_video(data: bytes | memoryview) -> CompressedVideo:
    """foxglove_msgs/CompressedVideo."""
    reader = CdrReader(data)
    stamp_ns, frame_id = reader.header()
    return CompressedVideo(stamp_ns, frame_id, bytes(reader.octets()), reader.string())


def decode_log(data: bytes | memoryview) -> Log:
    """rcl_interfaces/Log."""
    reader = CdrReader(data)
    stamp_ns, level = reader.time(), reader.integer("B")
    name, text, file, function = (reader.string() for _ in range(4))
    return Log(stamp_ns, level, name, text, file, function, reader.integer("I"))


def decode_diagnostics(data: bytes | memoryview) -> DiagnosticArray:
    """diagnostic_msgs/DiagnosticArray."""
    reader = CdrReader(data)
    stamp_ns, frame_id = reader.header()
    statuses = tuple(_status(reader) for _ in range(reader.length(17)))
    return DiagnosticArray(stamp_ns, frame_id, statuses)


def _status(reader: CdrReader) -> Status:
    level = reader.integer("B")
    name, message, hardware_id = reader.string(), reader.string(), reader.string()
    values = tuple((reader.string(), reader.string()) for _ in range(reader.length(8)))
    return Status(level, name, message, hardware_id, values)


def decode_transforms(data: bytes | memoryview) -> list[tuple[int, Transform]]:
    """tf2_msgs/TFMessage as (stamp, transform)."""
    reader = CdrReader(data)
    transforms = []
    for _ in range(reader.length(72)):
        stamp_ns, parent = reader.header()
        child = reader.string()
        x, y, z, qx, qy, qz, qw = reader.unpack("d", 7)
        transforms.append((stamp_ns, Transform(parent, child, (x, y, z), (qx, qy, qz, qw))))
    return transforms


DECODERS: dict[str, Callable[[bytes], Any]] = {
    schemas.POINT_CLOUD: decode_point_cloud,
    schemas.IMU: decode_imu,
    schemas.NAV_SAT_FIX: decode_fix,
    schemas.SENTENCE: decode_sentence,
    schemas.COMPRESSED_VIDEO: decode_video,
    schemas.LOG: decode_log,
    schemas.DIAGNOSTIC_ARRAY: decode_diagnostics,
    schemas.TF_MESSAGE: decode_transforms,
    schemas.ODOMETRY: decode_odometry,
    schemas.POSE: decode_pose,
    schemas.DETECTIONS: decode_detections,
}
"""ROS type -> decoder."""
