"""The recorder sends what is asked for, waits for nobody, and takes the results back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.messages import GnssFix, ImuSample, LidarScan
from edge.bus import envelope, results, server
from edge.bus.client import BusClient
from edge.bus.envelope import Envelope
from edge.bus.server import BusServer
from edge.config import Config
from edge.control.messages import Detecting, Location
from edge.errors import FormatError
from edge.live.intake import LiveIntake
from edge.recording.messages import DetectedBox, Detections, GnssPose, OdometryPose, Transforms
from edge.ros.frames import Transform
from tests.edge.recording import recording_scene as scene
from tests.waiting import wait_for

CONFIG = Config()
LOCATION = Location("tracking", 12.5, 1.2, 0.3, (1.0, 2.0, 3.0), True, 4, 0.5, 0.1)
DETECTING = Detecting("watching", "ailanthus", "ab12", "cpu", 2.0, 180.0, 3, 40, 560)
FOUND = Detections(5, 6, (DetectedBox((1.0, 2.0, 3.0, 4.0), 0.5, "ailanthus"),))
POSE = OdometryPose(5, 6, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), (0.5,) * 36, (0.1, 0.2, 0.3))


class Recorder:
    """A bus with what came back over it."""

    def __init__(self, folder) -> None:
        self.taken: list = []
        self.bus = BusServer(CONFIG, folder, self.taken.append)


@pytest.fixture
def recorder(tmp_path):
    made = Recorder(tmp_path)
    made.bus.start()
    assert not made.bus.problem
    yield made
    made.bus.stop()


def subscribed(recorder, kind) -> None:
    wait_for(lambda: recorder.bus._wants(kind))


def received(client, count: int) -> list[Envelope]:
    found: list[Envelope] = []

    def enough() -> bool:
        found.extend(client.receive(0.05))
        return len(found) >= count

    wait_for(enough)
    return found


def test_messages_arrive_as_they_were_offered(recorder, tmp_path):
    intake = LiveIntake(CONFIG.topics)
    with BusClient(tmp_path, intake.wanted) as client:
        subscribed(recorder, GnssFix)
        octets = np.full((3, 50), 7, np.uint8)
        sweep = LidarScan(8_000, 9_000, np.ones((50, 3), np.float32), *octets, np.arange(50, dtype=np.uint32))
        offered = [sweep, scene.imu(10_000), scene.nmea(11_000), scene.fix(12_000), scene.video(13_000)]
        for message in offered:
            recorder.bus.offer(message)
        decoded = [intake.decode(one) for one in received(client, 4)]
    scan, imu, sentence, fix = decoded
    assert isinstance(scan, LidarScan)
    np.testing.assert_array_equal(scan.offset_ns, sweep.offset_ns)
    assert (scan.stamp_ns, scan.receive_ns, scan.reflectivity[0]) == (8_000, 9_000, 7)
    assert isinstance(imu, ImuSample)
    assert imu == offered[1]
    assert sentence is None
    assert isinstance(fix, GnssFix)
    assert (fix.latitude_deg, fix.stamp_ns) == (47.0, 12_000)


def test_nothing_is_kept_for_nobody(recorder):
    for k in range(1000):
        recorder.bus.offer(scene.imu(k))
    assert recorder.bus.dropped == 0
    assert not recorder.bus._queue


def test_what_a_slow_pipeline_misses_is_counted(recorder, tmp_path):
    with BusClient(tmp_path, [CONFIG.topics.imu]) as client:
        subscribed(recorder, ImuSample)
        total = 20 * server.QUEUE_LENGTH
        for k in range(total):
            recorder.bus.offer(scene.imu(k))
        got = 0

        def last() -> bool:
            nonlocal got
            recorder.bus.offer(scene.imu(total))
            got += sum(1 for _ in client.receive(0.05))
            known = client._last.get(CONFIG.topics.imu, 0)
            return known >= total

        wait_for(last)
        assert got < total
        assert client.lost[CONFIG.topics.imu] + got == client._last[CONFIG.topics.imu] - first(client, got)


def first(client, got: int) -> int:
    """Messages before the first that arrived are unknown to the client."""
    return client._last[CONFIG.topics.imu] - client.lost[CONFIG.topics.imu] - got


def test_results_come_back_to_be_recorded_and_shown(recorder, tmp_path):
    turn = Transforms(5, 6, (Transform("odom", "base_link", (1.0, 2.0, 3.0)),))
    placed = GnssPose(5, 6, POSE.position_m, POSE.rotation_xyzw, POSE.covariance)
    with BusClient(tmp_path, []) as client:
        for result in (POSE, turn, placed, FOUND, DETECTING, LOCATION):
            client.send(result)
        wait_for(lambda: recorder.bus.location is not None)
    assert (recorder.bus.location, recorder.bus.detecting) == (LOCATION, DETECTING)
    assert recorder.taken[:2] == [POSE, turn]
    assert isinstance(recorder.taken[2], GnssPose)
    assert recorder.taken[3:] == [FOUND]


def test_the_pipeline_finds_a_recorder_that_starts_later_and_one_that_comes_back(tmp_path):
    with BusClient(tmp_path, [CONFIG.topics.imu]) as client:
        for _ in range(2):
            recorder = Recorder(tmp_path)
            recorder.bus.start()
            # ZeroMQ subscribes again only when the client looks.
            wait_for(lambda bus=recorder.bus: not list(client.receive(0.0)) and bus._wants(ImuSample))
            recorder.bus.offer(scene.imu(1))
            assert received(client, 1)[0].stamp_ns == 1
            recorder.bus.stop()
        assert client.lost.total() == 0


def test_without_a_recorder_results_are_dropped_and_counted(tmp_path):
    with BusClient(tmp_path, []) as client:
        for _ in range(server.HIGH_WATER + 50):
            client.send(POSE)
        assert client.unsent >= 1


def test_a_path_too_long_for_a_socket_is_said_and_nothing_else_happens(tmp_path):
    bus = BusServer(CONFIG, tmp_path / ("x" * 100), lambda _: None)
    bus.start()
    assert "set control.socket" in bus.problem
    bus.offer(scene.imu(1))
    bus.stop()


@given(st.lists(st.binary(max_size=60), min_size=1, max_size=4))
def test_any_bytes_are_refused_in_words(parts):
    for unpack in (envelope.unpacked, results.unpacked):
        try:
            unpack(parts)
        except FormatError:
            continue
