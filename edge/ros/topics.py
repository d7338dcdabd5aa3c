"""Which message goes to which topic, as which type, with which quality of service."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import msgspec

from drivers.messages import GnssFix, ImuSample, LidarScan, NmeaSentence, SensorEvent, VideoFrame
from edge.config import Topics
from edge.errors import ConfigError
from edge.recording.messages import Detections, Diagnostics, GnssPose, Mark, OdometryPose, Transforms
from edge.ros import schemas

_DURATIONS = "    sec: 9223372036\n    nsec: 854775807\n"


def _offered_qos(durability: int) -> str:
    """Integers, not words: old rosbag2 reads only these and new ones detect them."""
    return (
        f"- history: 1\n  depth: 10\n  reliability: 1\n  durability: {durability}\n"
        f"  deadline:\n{_DURATIONS}  lifespan:\n{_DURATIONS}"
        f"  liveliness: 1\n  liveliness_lease_duration:\n{_DURATIONS}  avoid_ros_namespace_conventions: false"
    )


VOLATILE_QOS = _offered_qos(2)
LATCHED_QOS = _offered_qos(1)
"""Transient local: who subscribes late still gets it."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One topic of a recording. `offered_qos` stands letter for letter in the channel and in `metadata.yaml`:
    `rosbags` yields no message at all, without an error, where the two differ."""

    topic: str
    type_name: str
    offered_qos: str = VOLATILE_QOS


def channels(topics: Topics) -> Mapping[type, Channel]:
    """The channel of each kind of message. ConfigError when two kinds of different type share a topic."""
    _refuse_shared(topics)
    events = Channel(topics.events, schemas.LOG)
    return {
        LidarScan: Channel(topics.lidar, schemas.POINT_CLOUD),
        ImuSample: Channel(topics.imu, schemas.IMU),
        GnssFix: Channel(topics.fix, schemas.NAV_SAT_FIX),
        NmeaSentence: Channel(topics.nmea, schemas.SENTENCE),
        VideoFrame: Channel(topics.video, schemas.COMPRESSED_VIDEO),
        Diagnostics: Channel(topics.diagnostics, schemas.DIAGNOSTIC_ARRAY),
        SensorEvent: events,
        Mark: events,
        OdometryPose: Channel(topics.odometry, schemas.ODOMETRY),
        GnssPose: Channel(topics.gnss_pose, schemas.POSE),
        Transforms: Channel(topics.tf, schemas.TF_MESSAGE),
        Detections: Channel(topics.detections, schemas.DETECTIONS),
    }


def _refuse_shared(topics: Topics) -> None:
    names = list(msgspec.structs.asdict(topics).items())
    for number, (key, topic) in enumerate(names):
        for other, same in names[:number]:
            if topic == same:
                raise ConfigError(f"topics.{key}: {topic!r} is also topics.{other}; each needs a name of its own")


def tf_static_channel(topics: Topics) -> Channel:
    """The channel of the static transforms."""
    return Channel(topics.tf_static, schemas.TF_MESSAGE, LATCHED_QOS)
