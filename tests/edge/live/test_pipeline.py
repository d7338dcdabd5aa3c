"""From messages on the bus to poses that are recorded, in the recorder's types."""

from __future__ import annotations

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from edge.bus.envelope import Envelope
from edge.config import Config
from edge.control.messages import Location
from edge.live.pipeline import LivePipeline
from edge.live.poses import odometry_pose
from edge.process.estimators import Estimators
from edge.process.sweep_odometry import Tracked
from edge.recording.messages import GnssPose, OdometryPose, Transforms
from edge.ros.encode import ENCODERS
from pipeline.estimates import GlobalPose, MapToOdom, OdometryEstimate
from pipeline.gnss.geodesy import Datum, geodetic
from tests.edge.recording import recording_scene as scene
from tests.edge.replay import foreign

CONFIG = Config()
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
STORE = get_typestore(Stores.ROS2_HUMBLE)


def estimate(stamp_ns: int = 5, *, degenerate: bool = False) -> OdometryEstimate:
    zero = np.zeros(3)
    covariance = np.diag([0.01, 0.04, 0.09, 1e-4, 2e-4, 3e-4])
    position, velocity = np.array([3.0, 2.0, 1.0]), np.array([0.0, 1.5, 0.0])
    return OdometryEstimate(
        *(stamp_ns, position, QUARTER, velocity, covariance, zero, zero, 12.5, degenerate, np.empty((0, 3)), 9, 8)
    )


class Odometry:
    def __init__(self, config) -> None:
        self.note = "keep still"
        self.sweeps: list = []

    def process(self, sweep):
        self.sweeps.append((sweep.scan.stamp_ns, len(sweep.imu)))
        if len(self.sweeps) >= 3:
            yield Tracked(estimate(sweep.scan.stamp_ns), np.empty((0, 4), np.float32))


class Fusion:
    note = "the receiver is late"

    def __init__(self, config) -> None:
        self.fixes: list = []

    def add_odometry(self, one) -> None: ...

    def add_fix(self, fix) -> None:
        self.fixes.append(fix)

    def state(self):
        return MapToOdom(5, np.array([10.0, 0.0, 0.0]), np.pi / 2, np.eye(4), (47.0, 8.0, 500.0), 3, 0, True)

    def global_pose(self, one):
        return GlobalPose(one.stamp_ns, np.array([7.0, 8.0, 9.0]), np.eye(3), np.eye(6) * 0.25) if self.fixes else None


class Bus:
    unsent = 0

    def __init__(self) -> None:
        self.waiting: list = []
        self.sent: list = []

    def receive(self, timeout_s):
        yield from self.waiting
        self.waiting.clear()

    def send(self, result) -> None:
        self.sent.append(result)

    def of(self, kind):
        return [result for result in self.sent if isinstance(result, kind)]


def put(bus: Bus, topic: str, message) -> None:
    data = ENCODERS[type(message)](message, message.stamp_ns)
    bus.waiting.append(Envelope(topic, 1, message.receive_ns, message.stamp_ns, data))


def walk(fixes: bool) -> tuple[LivePipeline, Bus]:
    clock = scene.FakeClock(0)
    pipeline = LivePipeline(CONFIG, lambda: Estimators(Odometry, None, Fusion), clock)
    bus = Bus()
    octets = np.full((3, foreign.POINTS), 9, np.uint8)
    kind = type(scene.scan(0))
    for k in range(6):
        at = scene.S + k * 100 * scene.MS
        clock.now_ns = at
        put(bus, CONFIG.topics.lidar, kind(at, at, foreign.xyz(), *octets, foreign.offsets_ns().astype(np.uint32)))
        for i in range(20):
            put(bus, CONFIG.topics.imu, scene.imu(at + i * 5 * scene.MS))
        if fixes:
            put(bus, CONFIG.topics.fix, scene.fix(at))
        pipeline.step(bus)
    return pipeline, bus


def test_poses_and_transforms_are_sent_once_a_sweep_from_the_first_estimate_on():
    pipeline, bus = walk(fixes=True)
    assert pipeline._odometry.sweeps[0][0] == scene.S
    poses = bus.of(OdometryPose)
    assert [pose.stamp_ns for pose in poses] == [scene.S + k * 100 * scene.MS for k in (2, 3, 4)]
    assert len(bus.of(Transforms)) == len(bus.of(GnssPose)) == 3
    earth, _, _ = transforms = bus.of(Transforms)[0].transforms
    assert [t.parent for t in transforms] == ["earth", "map", "odom"]
    enu = np.array([100.0, 200.0, 30.0])
    there = Rotation.from_quat(earth.rotation_xyzw).apply(enu) + earth.translation_m
    np.testing.assert_allclose(geodetic(there), Datum(47.0, 8.0, 500.0).geodetic(enu), atol=1e-8)


def test_the_operator_is_told_where_it_is_and_how_sure():
    pipeline, bus = walk(fixes=True)
    assert bus.of(Location)[0].state == "starting"
    assert bus.of(Location)[0].note == "keep still"
    now_ns = scene.S + 500 * scene.MS
    told = pipeline.location(now_ns)
    assert (told.state, told.georeferenced, told.position_m) == ("tracking", True, (7.0, 8.0, 9.0))
    assert (told.distance_m, told.speed_m_s, told.thinned) == (12.5, 1.5, 1.0)
    assert told.sigma_m == pytest.approx(0.5**0.5)
    assert pipeline.location(now_ns + 3 * scene.S).state == "lost"
    assert walk(fixes=False)[0].location(now_ns).georeferenced is False


def test_recorded_types_are_what_ros_reads():
    message = odometry_pose(estimate(), 6)
    read = STORE.deserialize_cdr(ENCODERS[OdometryPose](message, 1_500_000_000), "nav_msgs/msg/Odometry")
    assert (read.header.frame_id, read.child_frame_id, read.header.stamp.nanosec) == ("odom", "base_link", 500_000_000)
    assert read.pose.pose.position.x == 3.0
    assert read.pose.pose.orientation.z == pytest.approx(0.5**0.5)
    # The body turned by a quarter: its roll is the pitch of the fixed axes; forward speed is along its x.
    covariance = read.pose.covariance.reshape(6, 6)
    np.testing.assert_allclose(np.diag(covariance), [0.01, 0.04, 0.09, 2e-4, 1e-4, 3e-4], atol=1e-12)
    assert (read.twist.twist.linear.x, read.twist.twist.linear.y) == pytest.approx((1.5, 0.0))
    pose = GnssPose(5, 6, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), tuple(float(k) for k in range(36)))
    raw = ENCODERS[GnssPose](pose, 7)
    read = STORE.deserialize_cdr(raw, "geometry_msgs/msg/PoseWithCovarianceStamped")
    assert (read.header.frame_id, read.pose.covariance[35]) == ("map", 35.0)
    assert bytes(STORE.serialize_cdr(read, "geometry_msgs/msg/PoseWithCovarianceStamped")) == raw
