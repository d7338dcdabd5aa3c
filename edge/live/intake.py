"""Messages of the bus as the estimators take them. Our own layouts: nothing has to be found out."""

from __future__ import annotations

from drivers.messages import GnssFix, ImuSample, LidarScan
from edge.bus.envelope import Envelope
from edge.config import Topics
from edge.errors import FormatError
from edge.replay.clouds import CloudLayout, decode_cloud
from edge.replay.fixes import FixReader
from edge.replay.inertial import ImuLayout
from edge.replay.point_times import Origin, PointTimes
from edge.replay.store import Raw
from edge.ros import schemas
from edge.ros.frames import BASE_LINK, LIDAR

_TIMES = PointTimes("timestamp", 1, Origin.CLOCK)
_CLOUDS = CloudLayout(_TIMES, reflectivity="intensity", gain=1.0, line="line", frame_id=LIDAR, livox=True)
_IMU = ImuLayout(1.0, BASE_LINK)


class LiveIntake:
    """Decodes by topic."""

    def __init__(self, topics: Topics) -> None:
        self._topics = topics
        self._fixes = FixReader()

    @property
    def wanted(self) -> tuple[str, ...]:
        """Topics to subscribe to."""
        return (self._topics.lidar, self._topics.imu, self._topics.fix, self._topics.nmea)

    def decode(self, envelope: Envelope) -> LidarScan | ImuSample | GnssFix | None:
        """None for what says nothing by itself, and for what cannot be read."""
        raw = Raw(envelope.topic, envelope.receive_ns, envelope.stamp_ns, memoryview(envelope.data))
        try:
            if raw.topic == self._topics.imu:
                return _IMU.sample(raw)
            if raw.topic == self._topics.lidar:
                return _CLOUDS.scan(decode_cloud(schemas.POINT_CLOUD, raw.data), raw.log_ns)
            if raw.topic == self._topics.fix:
                return self._fixes.fix(raw)
            self._fixes.sentence(raw)
        except FormatError:
            pass  # the recording has it as it came; nothing here can use it
        return None
