"""The recorder records what the live pipeline hands back, and tells the operator where the payload is."""

from pathlib import Path

from mcap.reader import make_reader

from edge.bus.client import BusClient
from edge.control.messages import Detecting, Location, Request
from edge.recording.messages import Detections, OdometryPose
from edge.service.judge import Judge
from edge.service.service import Service
from edge.service.supervisor import Plan
from tests.edge.service.fakes import FakeDriver, config, imu, running
from tests.waiting import PATIENCE_S, wait_for

LOCATION = Location("tracking", 12.5, 1.2, 0.3, (1.0, 2.0, 3.0), True, 4, 0.5, 0.1)
DETECTING = Detecting("watching", "ailanthus", "ab12", "cpu", 2.0, 180.0, 3, 40, 560)
POSE = OdometryPose(5, 6, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), (0.5,) * 36, (0.1, 0.2, 0.3))


def test_the_pipeline_hears_the_sensors_and_its_poses_are_in_the_file(tmp_path: Path) -> None:
    driver, settings = FakeDriver(), config(tmp_path)
    service = Service(settings, plans=[Plan("fake", lambda: driver)], judge=Judge("", lambda _: ["false"]))
    with (
        running(service, tmp_path / "control.sock") as recorder,
        BusClient(tmp_path, [settings.topics.imu]) as pipeline,
    ):
        assert driver.running.wait(PATIENCE_S)
        assert recorder.status().location is None
        heard: list[int] = []

        def hears() -> bool:
            assert driver.emit is not None
            driver.emit(imu(7))
            heard.extend(one.stamp_ns for one in pipeline.receive(0.05))
            return 7 in heard

        wait_for(hears)
        folder = Path(recorder.request(Request("start")).folder)
        pipeline.send(POSE)
        pipeline.send(Detections(5, 6, ()))
        pipeline.send(DETECTING)
        pipeline.send(LOCATION)
        wait_for(lambda: recorder.status().location == LOCATION)
        assert recorder.status().detecting == DETECTING
        recorder.request(Request("stop"))
    with next(folder.glob("*.mcap")).open("rb") as file:
        found = [(channel.topic, schema.name) for schema, channel, _ in make_reader(file).iter_messages()]
    assert (settings.topics.odometry, "nav_msgs/msg/Odometry") in found
    assert (settings.topics.detections, "vision_msgs/msg/Detection2DArray") in found
