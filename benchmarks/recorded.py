"""Recordings of simulated walks, without the time that an emulated payload takes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from mcap.writer import CompressionType, Writer

from drivers.messages import GnssFix, ImuSample, LidarScan, VideoFrame
from edge.config import Topics
from edge.recording.summary import SESSION_RECORD
from edge.ros.encode import ENCODERS
from edge.ros.schemas import schema_text
from edge.ros.topics import channels

Message = LidarScan | ImuSample | GnssFix | VideoFrame


def write_recording(path: Path, messages: Iterable[Message]) -> None:
    """As the recorder writes it, in host time. Complete or not at all."""
    draft = path.with_suffix(".draft")
    with draft.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start("ros2", "mapforest")
        writer.add_metadata(SESSION_RECORD, {"anchor_utc_ns": "0", "anchor_monotonic_ns": "0"})
        used, ids = channels(Topics()), {}
        for kind in (LidarScan, ImuSample, GnssFix, VideoFrame):
            channel = used[kind]
            schema = writer.register_schema(channel.type_name, "ros2msg", schema_text(channel.type_name))
            ids[kind] = writer.register_channel(channel.topic, "cdr", schema)
        for message in messages:
            writer.add_message(
                ids[type(message)],
                log_time=message.receive_ns,
                data=ENCODERS[type(message)](message, message.stamp_ns),
                publish_time=message.stamp_ns,
            )
        writer.finish()
    draft.replace(path)
