"""A recording, whoever made it, as the messages our drivers emit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypeAlias

import numpy as np

from drivers.messages import GnssFix, ImuSample, LidarScan
from edge.config import Config
from edge.errors import FormatError
from edge.recording.calibration import load_calibration
from edge.replay import clouds, inertial
from edge.replay.fixes import FixReader
from edge.replay.geometry import Geometry, Matrix, find_geometry
from edge.replay.store import MessageStore, Raw
from edge.replay.topics import Chosen, Wanted, choose
from edge.ros.decode import decode_transforms
from edge.ros.frames import Transform
from edge.validation.told import recorded_config

_PROBED_CLOUDS = (0, 1, 2, 5, 10, 20, 50)
_PROBED_IMU = 400
Measurement: TypeAlias = LidarScan | ImuSample | GnssFix


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """What the caller knows better. lidar_pose: (4, 4) in the frame of the IMU."""

    wanted: Wanted = field(default_factory=Wanted)
    time_field: str = ""
    lidar_pose: Matrix | None = None


class Replay:
    """Opens and looks at a recording; FormatError says what it lacks. `messages` may be called again and again.

    Stamps are as in the recording: session time in ours, the header's in others.
    """

    def __init__(self, targets: Sequence[Path], config: Config, options: ReplayOptions | None = None) -> None:
        options = options or ReplayOptions()
        self._store = MessageStore(targets)
        facts = self._store.recording.facts
        recorded = recorded_config(facts) if facts is not None else None
        names = (recorded or config).topics
        self.topics: Chosen = choose(self._store.topics, self._store.count, names, options.wanted)
        self.facts: dict[str, str] = facts or {}
        self._cloud_type = self._store.topics[self.topics.lidar].type_name
        self._clouds = clouds.find_layout(
            self.topics.lidar, self._cloud_type, self._some(self.topics.lidar, _PROBED_CLOUDS), options.time_field
        )
        spread = np.linspace(0, max(self._store.count(self.topics.imu) - 1, 0), _PROBED_IMU).astype(int)
        self._imu = inertial.find_layout(self.topics.imu, self._some(self.topics.imu, sorted({*spread.tolist()})))
        self.geometry: Geometry = self._geometry(config, options)
        self.skipped: Counter[str] = Counter()
        """Messages of each topic that could not be used; counts while messages are read."""
        self._refuse_strange_clocks()

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found and what was assumed, in words."""
        return (
            f"LiDAR {self.topics.lidar} ({self._cloud_type}), time of points: {self._clouds.times}",
            f"IMU {self.topics.imu} in {self._imu.unit}",
            f"GNSS {self.topics.fix}" if self.topics.fix else "no GNSS in the recording",
            *self.geometry.notes,
        )

    @property
    def damages(self) -> tuple[str, ...]:
        """What could not be read, in words."""
        return tuple(self._store.damages)

    @property
    def files(self) -> tuple[Path, ...]:
        """The recording's files in order."""
        return tuple(index.path for index in self._store.files)

    @property
    def scans(self) -> int:
        """How many there are."""
        return self._store.count(self.topics.lidar)

    @property
    def duration_s(self) -> float:
        """From the first to the last scan, by arrival."""
        times = self._store.times_ns(self.topics.lidar)
        return float(np.ptp(times)) / 1e9 if len(times) else 0.0

    def messages(self, *, gnss: bool = True) -> Iterator[Measurement]:
        """Every scan, inertial sample and fix in order of arrival, decoded one by one."""
        topics = self.topics
        wanted = {topics.lidar, topics.imu, *((topics.fix, topics.nmea) if gnss else ())} - {""}
        fixes = FixReader()
        for raw in self._store.messages(wanted):
            try:
                message = self._decode(raw, fixes)
            except FormatError:
                message = None
                self.skipped[raw.topic] += 1
            if message is not None:
                yield message

    def _decode(self, raw: Raw, fixes: FixReader) -> Measurement | None:
        if raw.topic == self.topics.imu:
            return self._imu.sample(raw)
        if raw.topic == self.topics.lidar:
            return self._clouds.scan(clouds.decode_cloud(self._cloud_type, raw.data), raw.log_ns)
        if raw.topic == self.topics.fix:
            return fixes.fix(raw)
        fixes.sentence(raw)
        return None

    def _some(self, topic: str, ordinals: Sequence[int]) -> Iterator[Raw]:
        return self._store.some(topic, ordinals)

    @cached_property
    def static_transforms(self) -> list[Transform]:
        """Of /tf_static."""
        recorded: list[Transform] = []
        if self.topics.tf_static:
            for raw in self._store.some(self.topics.tf_static, range(20)):
                recorded += [transform for _, transform in decode_transforms(raw.data)]
        return recorded

    def _geometry(self, config: Config, options: ReplayOptions) -> Geometry:
        usual = load_calibration(config.calibration).transforms
        recorded = self.static_transforms
        found = find_geometry(recorded, usual, self._imu.frame_id, self._clouds.frame_id, livox=self._clouds.livox)
        return found if options.lidar_pose is None else Geometry(options.lidar_pose, found.antenna)

    def _refuse_strange_clocks(self) -> None:
        """LiDAR and IMU have to be in one clock: nothing here could put them together to the millisecond."""
        scan = next((self._scan(raw) for raw in self._some(self.topics.lidar, range(3))), None)
        first = [
            self._imu.sample(raw) for raw in self._some(self.topics.imu, (0, self._store.count(self.topics.imu) - 1))
        ]
        stamps = [sample.stamp_ns for sample in first if sample is not None]
        if scan is None or not stamps:
            return
        slack_ns = 2_000_000_000
        if not min(stamps) - slack_ns <= scan.stamp_ns <= max(stamps) + slack_ns:
            raise FormatError(
                f"{self.topics.lidar} and {self.topics.imu} are stamped by different clocks: the first sweep is at "
                f"{scan.stamp_ns / 1e9:.3f} s, the inertial data from {min(stamps) / 1e9:.3f} to "
                f"{max(stamps) / 1e9:.3f} s; synchronise the sensors (PTP), or record an IMU of the LiDAR's own clock"
            )

    def _scan(self, raw: Raw) -> LidarScan | None:
        return self._clouds.scan(clouds.decode_cloud(self._cloud_type, raw.data), raw.log_ns)
