"""What a recording has for a calibration: the gyroscope, pictures, and which units made it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from drivers.messages import LidarScan
from edge.calibration.units import CAMERA, LIDAR, Units, serial_of
from edge.config import Config
from edge.errors import FormatError
from edge.replay import clouds, inertial
from edge.replay.frames import VideoFrames, video_topic
from edge.replay.store import MessageStore
from edge.replay.topics import Chosen, Wanted, choose
from edge.replay.video import Choose
from edge.ros.decode import decode_diagnostics
from pipeline.calibration.image_turning import Picture
from pipeline.calibration.turning import Turning, of_gyro

_PROBED_IMU = 400
_PROBED_CLOUDS = (0, 1, 2, 5)
_UNITS = {f"sensor/{LIDAR}": "lidar", f"sensor/{CAMERA}": "camera"}


class CalibrationRecording:
    """Opens a session folder, a bag or a file. FormatError for what lacks a LiDAR or an IMU."""

    def __init__(self, target: Path, config: Config) -> None:
        self.store = MessageStore([target])
        self.name = target.absolute().name
        names = self.store.recording.effective(config).topics
        self.topics: Chosen = choose(self.store.topics, self.store.count, names, Wanted())
        self.video = video_topic(self.store.topics, names)
        self._diagnostics = names.diagnostics

    def gyro(self) -> Turning:
        """Of the IMU, in `base_link`, by the recording's stamps."""
        topic = self.topics.imu
        spread = np.linspace(0, max(self.store.count(topic) - 1, 0), _PROBED_IMU).astype(int)
        layout = inertial.find_layout(topic, self.store.some(topic, sorted({*spread.tolist()})))
        samples = [sample for raw in self.store.messages({topic}) if (sample := layout.sample(raw)) is not None]
        stamps = np.array([sample.stamp_ns for sample in samples], np.int64)
        return of_gyro(stamps, np.array([sample.angular_velocity for sample in samples]).reshape(-1, 3))

    def video_span_ns(self) -> tuple[int, int]:
        """When the first and the last frame of video arrived. FormatError when there is none."""
        times = self.store.times_ns(self.video) if self.video else np.empty(0, np.int64)
        if not len(times):
            raise FormatError(f"{self.name}: no video in this recording; was the camera on?")
        return int(times.min()), int(times.max())

    def pictures(self, choose_: Choose) -> Iterator[Picture]:
        """Grey ones, as the camera stamped them. FormatError when there are none."""
        for stamp_ns, image in self.images(choose_):
            yield Picture(stamp_ns, np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8))

    def images(self, choose_: Choose) -> Iterator[tuple[int, npt.NDArray[np.uint8]]]:
        """Stamp and BGR image. FormatError when there are none."""
        self.video_span_ns()
        for frame in VideoFrames(self.store, self.video).read(choose_):
            yield frame.stamp_ns, frame.image_bgr

    def scans(self, first_ns: int, last_ns: int) -> Iterator[LidarScan]:
        """The sweeps stamped between two instants."""
        topic = self.topics.lidar
        kind = self.store.topics[topic].type_name
        layout = clouds.find_layout(topic, kind, self.store.some(topic, _PROBED_CLOUDS), "")
        for raw in self.store.messages({topic}):
            if raw.log_ns < first_ns or raw.publish_ns > last_ns + 1_000_000_000:
                continue
            scan = layout.scan(clouds.decode_cloud(kind, raw.data), raw.log_ns)
            if scan is not None and first_ns <= scan.stamp_ns <= last_ns:
                yield scan

    def units(self) -> Units:
        """The serial numbers that its diagnostics tell; empty ones where they do not."""
        found: dict[str, str] = {}
        count = self.store.count(self._diagnostics)
        for raw in self.store.some(self._diagnostics, sorted({0, count // 2, max(count - 1, 0)})):
            for status in decode_diagnostics(raw.data).statuses:
                serial = serial_of(dict(status.values))
                if status.name in _UNITS and serial:
                    found[_UNITS[status.name]] = serial
        return Units(found.get("lidar", ""), found.get("camera", ""))
