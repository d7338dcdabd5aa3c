"""Which topic is the LiDAR, the IMU, the receiver: by name where the configuration's is there, else by type."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from edge.config import Topics
from edge.errors import FormatError
from edge.ros import schemas
from edge.validation.index import Topic


@dataclass(frozen=True, slots=True)
class Chosen:
    """Topic names. fix, nmea, tf_static: empty where the recording has none."""

    lidar: str
    imu: str
    fix: str
    nmea: str
    tf_static: str


@dataclass(frozen=True, slots=True)
class Wanted:
    """Names given on the command line; empty: chosen here."""

    lidar: str = ""
    imu: str = ""
    fix: str = ""


Count = Callable[[str], int]
"""Messages on a topic."""


def choose(topics: Mapping[str, Topic], count: Count, names: Topics, wanted: Wanted) -> Chosen:
    """FormatError when there is no LiDAR or no IMU, with what there is."""
    live = {name: topic for name, topic in topics.items() if topic.encoding in ("cdr", "") and count(name)}
    lidar = _lidar(live, count, names.lidar, wanted.lidar)
    return Chosen(
        lidar=lidar,
        imu=_imu(live, count, names.imu, wanted.imu, lidar),
        fix=_optional(live, count, schemas.NAV_SAT_FIX, names.fix, wanted.fix),
        nmea=_optional(live, count, schemas.SENTENCE, names.nmea, ""),
        tf_static=_optional(live, count, schemas.TF_MESSAGE, names.tf_static, "")
        if names.tf_static in live or "/tf_static" in live
        else "",
    )


def _is_cloud(topic: Topic) -> bool:
    return topic.type_name == schemas.POINT_CLOUD or topic.type_name.endswith("/CustomMsg")


def _lidar(live: Mapping[str, Topic], count: Count, usual: str, wanted: str) -> str:
    clouds = [name for name, topic in live.items() if _is_cloud(topic)]
    if wanted:
        return _named(live, wanted, clouds, "point clouds")
    if usual in clouds:
        return usual
    if not clouds:
        raise FormatError(
            "no LiDAR in this recording: no topic of type sensor_msgs/msg/PointCloud2 or livox_ros_driver2/msg/"
            f"CustomMsg; there is {_told(live)}"
        )
    # Maps and filtered clouds come seldom; a raw sweep is also never called "map".
    return max(clouds, key=lambda name: ("map" not in name, count(name), _is_livox(live[name]), name))


def _is_livox(topic: Topic) -> bool:
    return topic.type_name.endswith("/CustomMsg")


def _imu(live: Mapping[str, Topic], count: Count, usual: str, wanted: str, lidar: str) -> str:
    found = [name for name, topic in live.items() if topic.type_name == schemas.IMU]
    if wanted:
        return _named(live, wanted, found, "inertial data")
    if usual in found:
        return usual
    if not found:
        raise FormatError(
            "no IMU in this recording: no topic of type sensor_msgs/msg/Imu; LiDAR-inertial odometry cannot do "
            f"without. There is {_told(live)}. Record the LiDAR's own IMU topic as well"
        )
    # The LiDAR's own IMU shares its name space and its clock.
    return max(found, key=lambda name: (_shared(name, lidar), count(name), name))


def _shared(one: str, other: str) -> int:
    """Leading parts that two names have in common."""
    pairs = zip(one.split("/")[:-1], other.split("/")[:-1], strict=False)
    common = 0
    for a, b in pairs:
        if a != b:
            break
        common += 1
    return common


def _optional(live: Mapping[str, Topic], count: Count, type_name: str, usual: str, wanted: str) -> str:
    found = [name for name, topic in live.items() if topic.type_name == type_name]
    if wanted:
        return _named(live, wanted, found, type_name)
    if usual in found:
        return usual
    return max(found, key=lambda name: (name == "/tf_static", count(name), name), default="")


def _named(live: Mapping[str, Topic], wanted: str, fitting: list[str], what: str) -> str:
    if wanted in fitting:
        return wanted
    state = f"is {live[wanted].type_name}" if wanted in live else "is not in this recording"
    raise FormatError(f"topic {wanted!r} {state}; {what} are on {', '.join(sorted(fitting)) or 'no topic'}")


def _told(live: Mapping[str, Topic]) -> str:
    return ", ".join(f"{name} ({topic.type_name})" for name, topic in sorted(live.items())) or "nothing"
