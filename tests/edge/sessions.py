"""Sessions as the recorder writes them, in small: right topics, types, rates and stamps, tiny payloads."""

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path

from mcap.writer import Writer

from tests.edge.recordings import CODECS, QOS, START_NS

SECOND = 1_000_000_000
TOPICS = {
    "/livox/lidar": ("sensor_msgs/msg/PointCloud2", 10.0),
    "/livox/imu": ("sensor_msgs/msg/Imu", 200.0),
    "/gnss/fix": ("sensor_msgs/msg/NavSatFix", 5.0),
    "/gnss/nmea": ("nmea_msgs/msg/Sentence", 15.0),
    "/camera/video": ("foxglove_msgs/msg/CompressedVideo", 29.97),
    "/diagnostics": ("diagnostic_msgs/msg/DiagnosticArray", 1.0),
}


@dataclass
class Stream:
    """One topic. silent: (from, to) seconds without messages. start_s, end_s: when it lives."""

    type_name: str
    rate_hz: float
    start_s: float = 0.0
    end_s: float = 1e9
    silent: tuple[tuple[float, float], ...] = ()
    latency_s: float = 0.004
    stamp_jumps: dict[int, float] = field(default_factory=dict)
    """Message number -> seconds its stamp is moved by."""


def streams(**changes) -> dict[str, Stream]:
    """The nominal streams. changes: last part of the name -> changed fields, or None."""
    found = {}
    for topic, (type_name, rate_hz) in TOPICS.items():
        change = changes.get(topic.rsplit("/", 1)[-1], {})
        if change is not None:
            found[topic] = Stream(**({"type_name": type_name, "rate_hz": rate_hz} | change))
    return found


def stamped(stamp_ns: int, frame: str, rest: bytes = b"") -> bytes:
    """CDR of a message that begins with a header."""
    text = frame.encode() + b"\0"
    head = b"\x00\x01\x00\x00" + struct.pack("<iII", stamp_ns // SECOND, stamp_ns % SECOND, len(text)) + text
    return head + rest


def fix(stamp_ns: int, status: int) -> bytes:
    """CDR of a NavSatFix up to its position."""
    head = stamped(stamp_ns, "gnss_antenna") + struct.pack("b", status)
    head += bytes(len(head) % 2) + struct.pack("<H", 15)
    head += bytes(-(len(head) - 4) % 8)
    return head + struct.pack("<3d", 48.1 if status >= 0 else float("nan"), 11.5, 500.0)


def write_session(
    path: Path,
    *,
    seconds: float = 20.0,
    changes: dict | None = None,
    codec: str = "none",
    session: dict[str, str] | None = None,
    summary: dict | None = None,
    statuses: tuple[int, ...] = (0,),
    start_s: float = 0.0,
    finish: bool = True,
    tf: bool = True,
    payload: int = 200,
) -> Path:
    """A file of ours. session None: without begin and end record, as others record. summary {}: without end record."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1 << 16, compression=CODECS[codec])
        writer.start("ros2", "test")
        if session is not None:
            writer.add_metadata("session", session)
        channels = {}
        events = []
        for topic, one in streams(**(changes or {})).items():
            schema = writer.register_schema(one.type_name, "ros2msg", b"# " + one.type_name.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": QOS})
            events += [(at, topic, number) for number, at in _times(one, start_s, start_s + seconds)]
        if tf:
            schema = writer.register_schema("tf2_msgs/msg/TFMessage", "ros2msg", b"# tf")
            channel = writer.register_channel("/tf_static", "cdr", schema, {"offered_qos_profiles": QOS})
            at = START_NS + int(start_s * SECOND)
            writer.add_message(channel, at, b"\x00\x01\x00\x00" + bytes(4), at)
        table = streams(**(changes or {}))
        for at, topic, number in sorted(events):
            one = table[topic]
            stamp = at - int((one.latency_s - one.stamp_jumps.get(number, 0.0)) * SECOND)
            status = statuses[number * len(statuses) // max(1, int(seconds * one.rate_hz)) % len(statuses)]
            data = fix(stamp, status) if topic == "/gnss/fix" else stamped(stamp, "frame", bytes(payload))
            writer.add_message(channels[topic], at, data, stamp, number)
        if session is not None and finish and summary != {}:
            writer.add_metadata("mapforest", {"summary": json.dumps(summary or {"ended": "stopped"})})
        if finish:
            writer.finish()
    return path


def _times(one: Stream, start_s: float, end_s: float):
    number = 0
    while (at_s := start_s + number / one.rate_hz) < end_s:
        alive = one.start_s <= at_s < one.end_s and not any(a <= at_s < b for a, b in one.silent)
        if alive:
            yield number, START_NS + round(at_s * SECOND)
        number += 1
