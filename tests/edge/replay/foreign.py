"""Recordings as others make them, serialised by `rosbags` and written by the mcap library."""

from __future__ import annotations

from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START_NS = 1_780_000_000_000_000_000
SWEEP_NS = 100_000_000
POINTS = 400
_CUSTOM_POINT = "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
_CUSTOM = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"
    "livox_ros_driver2/CustomPoint[] points\n"
)
_VIDEO = "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n"
STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(
    get_types_from_msg(_CUSTOM_POINT, "livox_ros_driver2/msg/CustomPoint")
    | get_types_from_msg(_CUSTOM, "livox_ros_driver2/msg/CustomMsg")
    | get_types_from_msg(_VIDEO, "foxglove_msgs/msg/CompressedVideo")
)
T = STORE.types
_DATATYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


def header(stamp_ns: int, frame: str):
    time = T["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    return T["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def xyz(points: int = POINTS) -> np.ndarray:
    angles = np.linspace(0.0, 2 * np.pi, points, endpoint=False)
    return np.column_stack([5 * np.cos(angles), 5 * np.sin(angles), np.linspace(0.0, 2.0, points)]).astype(np.float32)


def offsets_ns(points: int = POINTS) -> np.ndarray:
    return np.linspace(0, SWEEP_NS - 250_000, points).astype(np.int64)


def cloud(stamp_ns: int, fields: dict[str, tuple[str, np.ndarray]], frame: str = "lidar", height: int = 1):
    """PointCloud2 of these fields, with a byte of padding after each point, as PCL leaves some."""
    names = list(fields)
    offsets = np.cumsum([0, *(np.dtype(code).itemsize for code, _ in fields.values())])
    layout = {"names": names, "formats": [c for c, _ in fields.values()], "offsets": offsets[:-1].tolist()}
    dtype = np.dtype({**layout, "itemsize": int(offsets[-1]) + 1})
    points = np.zeros(len(fields["x"][1]), dtype)
    for name, (_, values) in fields.items():
        points[name] = values
    field = T["sensor_msgs/msg/PointField"]
    described = [
        field(name=name, offset=int(at), datatype=_DATATYPES[code], count=1)
        for name, at, (code, _) in zip(names, offsets, fields.values(), strict=False)
    ]
    width = len(points) // height
    return T["sensor_msgs/msg/PointCloud2"](
        header=header(stamp_ns, frame),
        height=height,
        width=width,
        fields=described,
        is_bigendian=False,
        point_step=dtype.itemsize,
        row_step=dtype.itemsize * width,
        data=points.view(np.uint8).copy() if points.ndim == 0 else np.frombuffer(points.tobytes(), np.uint8),
        is_dense=True,
    )


def plain(stamp_ns: int, time: tuple[str, str, np.ndarray] | None = None, **kwargs):
    """x, y, z, intensity and a time field (name, code, values)."""
    axes = {name: ("f4", values) for name, values in zip("xyz", xyz().T, strict=True)}
    fields = {**axes, "intensity": ("f4", np.linspace(0, 250, POINTS))}
    if time is not None:
        fields[time[0]] = time[1:]
    return cloud(stamp_ns, fields, **kwargs)


def custom(stamp_ns: int, frame: str = "livox_frame"):
    point = T["livox_ros_driver2/msg/CustomPoint"]
    points = [
        point(offset_time=int(t), x=float(x), y=float(y), z=float(z), reflectivity=7, tag=16, line=3)
        for t, (x, y, z) in zip(offsets_ns(), xyz(), strict=True)
    ]
    return T["livox_ros_driver2/msg/CustomMsg"](
        header=header(stamp_ns, frame),
        timebase=stamp_ns,
        point_num=len(points),
        lidar_id=1,
        rsvd=np.zeros(3, np.uint8),
        points=points,
    )


def imu(stamp_ns: int, acceleration: float, frame: str = "imu"):
    vector, quaternion = T["geometry_msgs/msg/Vector3"], T["geometry_msgs/msg/Quaternion"]
    return T["sensor_msgs/msg/Imu"](
        header=header(stamp_ns, frame),
        orientation=quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.zeros(9),
        angular_velocity=vector(x=0.01, y=-0.02, z=0.03),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(x=0.0, y=0.0, z=acceleration),
        linear_acceleration_covariance=np.zeros(9),
    )


def fix(stamp_ns: int, status: int = 0, sigma_m: float = 1.5, latitude: float = 47.0):
    state = T["sensor_msgs/msg/NavSatStatus"](status=status, service=1)
    return T["sensor_msgs/msg/NavSatFix"](
        header=header(stamp_ns, "gps"),
        status=state,
        latitude=latitude,
        longitude=8.0,
        altitude=500.0,
        position_covariance=np.diag([sigma_m**2] * 2 + [4 * sigma_m**2]).ravel(),
        position_covariance_type=2,
    )


def video(stamp_ns: int, unit: bytes, codec: str = "h264"):
    """One access unit."""
    time = header(stamp_ns, "").stamp
    data = np.frombuffer(unit, np.uint8)
    return T["foxglove_msgs/msg/CompressedVideo"](timestamp=time, frame_id="camera", data=data, format=codec)


def transform(parent: str, child: str, x: float, yaw_half: float = 0.0):
    vector, quaternion = T["geometry_msgs/msg/Vector3"], T["geometry_msgs/msg/Quaternion"]
    one = T["geometry_msgs/msg/TransformStamped"](
        header=header(0, parent),
        child_frame_id=child,
        transform=T["geometry_msgs/msg/Transform"](
            translation=vector(x=x, y=0.0, z=0.0),
            rotation=quaternion(x=0.0, y=0.0, z=float(np.sin(yaw_half)), w=float(np.cos(yaw_half))),
        ),
    )
    return T["tf2_msgs/msg/TFMessage"](transforms=[one])


@dataclass
class Bag:
    """Messages of one recording: (topic, log time, message)."""

    messages: list

    def add(self, topic: str, log_ns: int, message) -> None:
        self.messages.append((topic, log_ns, message))

    def write(self, path: Path, *, chunk_size: int = 20_000, chunked: bool = True) -> Path:
        """In order of time."""
        with path.open("wb") as stream:
            writer = Writer(stream, chunk_size=chunk_size, compression=CompressionType.LZ4, use_chunking=chunked)
            writer.start("ros2", "test")
            ids: dict[str, int] = {}
            for topic, log_ns, message in sorted(self.messages, key=itemgetter(1)):
                if topic not in ids:
                    schema = writer.register_schema(message.__msgtype__, "ros2msg", b"")
                    ids[topic] = writer.register_channel(topic, "cdr", schema, {})
                data = bytes(STORE.serialize_cdr(message, message.__msgtype__))
                writer.add_message(ids[topic], log_ns, data, log_ns)
            writer.finish()
        return path


def walk(
    make_scan, sweeps: int = 6, acceleration: float = 9.81, lidar: str = "/points", imu_topic: str = "/imu"
) -> Bag:
    """Sweeps by `make_scan(stamp_ns)`, published at their end, and 200 Hz of inertial data."""
    bag = Bag([])
    for k in range(sweeps):
        stamp_ns = START_NS + k * SWEEP_NS
        for i in range(20):
            at = stamp_ns + i * 5_000_000
            bag.add(imu_topic, at + 1_000_000, imu(at, acceleration))
        bag.add(lidar, stamp_ns + SWEEP_NS, make_scan(stamp_ns))
    return bag


def walk_with_fixes(path: Path, sweeps: int = 8) -> Path:
    """A walk whose sweeps have a fix each."""
    bag = walk(custom, sweeps=sweeps)
    for k in range(sweeps):
        bag.add("/fix", START_NS + k * SWEEP_NS, fix(START_NS + k * SWEEP_NS))
    return bag.write(path)
