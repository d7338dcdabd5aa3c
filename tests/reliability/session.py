"""What is in a session, read by the mcap library and by rosbags, and taken apart by number."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from edge.ros.decode import (
    Log,
    NavSatFix,
    Status,
    decode_diagnostics,
    decode_fix,
    decode_imu,
    decode_log,
    decode_point_cloud,
    decode_sentence,
    decode_video,
)
from tests.reliability.sources import METRES_AN_EPOCH, RETURNS, eastings_m, frame_number


@dataclass(frozen=True)
class Stamped:
    """One message: log and publish time, and its bytes."""

    log_ns: int
    stamp_ns: int
    data: bytes


class Session:
    """A finished session. Opening it already proves that two other libraries read it, and the same count."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.topics: dict[str, list[Stamped]] = defaultdict(list)
        for path in sorted(folder.glob("*.mcap"), key=lambda path: int(path.stem.rpartition("_")[2])):
            with path.open("rb") as file:
                for _, channel, message in make_reader(file, validate_crcs=True).iter_messages():
                    self.topics[channel.topic].append(Stamped(message.log_time, message.publish_time, message.data))
        with AnyReader([folder]) as bag:
            assert bag.message_count == sum(map(len, self.topics.values())) == sum(1 for _ in bag.messages())

    @cached_property
    def record(self) -> dict:
        """`session.json`."""
        loaded: dict = json.loads((self.folder / "session.json").read_text())
        return loaded

    @property
    def anchor_ns(self) -> int:
        """Session time minus host time."""
        return int(self.record["anchor_utc_ns"]) - int(self.record["anchor_monotonic_ns"])

    def last_host_ns(self) -> int:
        """Reception of the newest message on the host's monotonic clock; the start when there is none."""
        newest = [messages[-1].log_ns - self.anchor_ns for messages in self.topics.values() if messages]
        return max([int(self.record["anchor_monotonic_ns"]), *newest])

    def log_s(self, topic: str) -> np.ndarray:
        """Reception times."""
        return np.array([message.log_ns for message in self.topics[topic]]) / 1e9

    def stamps_ns(self, topic: str) -> np.ndarray:
        """Measurement times, in the order of the file."""
        return np.array([message.stamp_ns for message in self.topics[topic]], np.int64)

    @cached_property
    def samples(self) -> np.ndarray:
        """Numbers of the inertial samples in the order of the file."""
        readings = [decode_imu(message.data) for message in self.topics["/livox/imu"]]
        assert {one.linear_acceleration for one in readings} <= {(0.0, 0.0, 9.80665)}
        return np.array([one.angular_velocity[2] for one in readings]).astype(np.int64)

    @cached_property
    def packets(self) -> dict[int, int]:
        """Points recorded of each LiDAR packet by its number: RETURNS each, fewer in the first and the last."""
        found: Counter[int] = Counter()
        for message in self.topics["/livox/lidar"]:
            points = decode_point_cloud(message.data).points
            numbers, counts = np.unique(np.rint(points["y"] * 1000).astype(np.int64), return_counts=True)
            np.testing.assert_allclose(points["z"], -0.3, atol=1e-6)
            found.update(dict(zip(numbers.tolist(), counts.tolist(), strict=True)))
        return dict(sorted(found.items()))

    @property
    def doubled(self) -> list[int]:
        """Packets of which more was recorded than was sent."""
        return [number for number, points in self.packets.items() if points > RETURNS]

    @property
    def partial(self) -> list[int]:
        """Packets of which less was recorded than was sent, but for the session's first and last."""
        return [number for number, points in list(self.packets.items())[1:-1] if points < RETURNS]

    @cached_property
    def frames(self) -> np.ndarray:
        """Numbers of the frames in the order of the file, each of them compared with what was sent."""
        return np.array([frame_number(decode_video(message.data).data) for message in self.topics["/camera/video"]])

    @cached_property
    def fixes(self) -> list[NavSatFix]:
        return [decode_fix(message.data) for message in self.topics["/gnss/fix"]]

    @property
    def epochs(self) -> np.ndarray:
        """Numbers of the GNSS epochs, by how far east they are."""
        eastings = eastings_m(np.array([fix.longitude_deg for fix in self.fixes])) / METRES_AN_EPOCH
        return np.rint(eastings - eastings[0]).astype(np.int64)

    @property
    def sentences(self) -> list[str]:
        return [decode_sentence(message.data).sentence for message in self.topics["/gnss/nmea"]]

    @property
    def events(self) -> list[Log]:
        return [decode_log(message.data) for message in self.topics["/events"]]

    def told(self, words: str) -> list[str]:
        """Events that say this."""
        return [event.text for event in self.events if words in event.text]

    def diagnostics(self, part: str) -> list[Status]:
        """The states of a part, in time."""
        arrays = [decode_diagnostics(message.data) for message in self.topics["/diagnostics"]]
        return [status for array in arrays for status in array.statuses if status.name == part]

    def counted(self, part: str, key: str) -> int:
        """By how much a counter of a sensor rose in the session."""
        values = [int(dict(status.values).get(key, "0")) for status in self.diagnostics(f"sensor/{part}")]
        return values[-1] - values[0]
