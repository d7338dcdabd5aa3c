"""Small MCAP files for tests, written by the mcap library, and independent ways to read them."""

import random
import struct
from collections import Counter
from io import BytesIO
from pathlib import Path

import zstandard
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

CODECS = {"none": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}
START_NS = 1_780_000_000_000_000_000
_FOREVER = "\n    sec: 2147483647\n    nsec: 4294967295\n"
QOS = (
    f"- history: 1\n  depth: 10\n  reliability: 1\n  durability: 2\n  deadline:{_FOREVER}  lifespan:{_FOREVER}"
    f"  liveliness: 1\n  liveliness_lease_duration:{_FOREVER}  avoid_ros_namespace_conventions: false\n"
)
TYPES = {"/imu": "sensor_msgs/msg/Imu", "/cloud": "sensor_msgs/msg/PointCloud2", "/late": "std_msgs/msg/String"}


def write_recording(path: Path, codec: str = "none", seconds: float = 2.0, **options) -> Path:
    """200 Hz /imu, 10 Hz /cloud, and /late, whose definition comes only half way; metadata at both ends."""
    path.write_bytes(recording_bytes(codec, seconds, **options))
    return path


def recording_bytes(codec: str = "none", seconds: float = 2.0, finish: bool = True, **options) -> bytes:
    noise = random.Random(1)
    stream = BytesIO()
    writer = Writer(stream, **({"chunk_size": 4096, "compression": CODECS[codec]} | options))
    writer.start("ros2", "test")
    writer.add_metadata("session", {"software": "test"})
    channels: dict[str, int] = {}

    def add(topic: str, log_time: int, sequence: int, size: int) -> None:
        if topic not in channels:
            schema = writer.register_schema(TYPES[topic], "ros2msg", b"uint8 x\n")
            channels[topic] = writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": QOS})
        payload = b"\x00\x01\x00\x00" + noise.randbytes(size // 2) + bytes(size - size // 2)
        writer.add_message(channels[topic], log_time, payload, log_time - 1_000_000, sequence)

    for i in range(int(seconds * 200)):
        log_time = START_NS + i * 5_000_000
        add("/imu", log_time, i, 60)
        if i % 20 == 0:
            add("/cloud", log_time + 1, i // 20, 700)
        if i * 2 > seconds * 200 and i % 10 == 0:
            add("/late", log_time + 2, i // 10, 20)
    if finish:
        writer.add_metadata("mapforest", {"summary": "{}"})
        writer.finish()
    return stream.getvalue()


def streamed_messages(data: bytes) -> list[tuple[str, int, bytes]]:
    """Every message of every complete, sound chunk, as the mcap library's StreamReader sees it."""
    channels: dict[int, str] = {}
    found = []
    try:
        for record in StreamReader(BytesIO(data), emit_chunks=True).records:
            inner = breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [record]
            for item in inner:
                if isinstance(item, Channel):
                    channels[item.id] = item.topic
                elif isinstance(item, Message):
                    found.append((channels[item.channel_id], item.log_time, item.data))
    except (EndOfFile, McapError, ValueError, RuntimeError, struct.error, zstandard.ZstdError):
        pass
    return found


def read_messages(path: Path) -> list[tuple[str, int, bytes]]:
    """Every message through the index, checksums on, in file order."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages(log_time_order=False)]
        assert summary.statistics.message_count == len(messages)
        topics = {summary.channels[i].topic: n for i, n in summary.statistics.channel_message_counts.items() if n}
        assert topics == dict(Counter(topic for topic, _, _ in messages))
        assert summary.statistics.chunk_count == len(summary.chunk_indexes)
    with path.open("rb") as stream:  # front to back as well
        list(StreamReader(stream, validate_crcs=True).records)
    return messages


def rosbags_counts(path: Path) -> dict[str, int]:
    """Messages per topic as the rosbags library reads a single file."""
    from rosbags.rosbag2.storage_mcap import McapReader  # noqa: PLC0415

    reader = McapReader(path)
    reader.open()
    counts = Counter(connection.topic for connection, _, _ in reader.messages(reader.connections))
    reader.close()
    return dict(counts)
