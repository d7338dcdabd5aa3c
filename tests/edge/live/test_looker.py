"""The newest image is looked at, older ones are passed over, and the odometry is let alone."""

from __future__ import annotations

import importlib
import os
import threading

import numpy as np
import pytest

from drivers.messages import VideoFrame
from edge.bus.envelope import Envelope
from edge.config import Config, Detection, Topics
from edge.live import detection as module
from edge.live.detection import LiveDetection
from edge.live.looker import Looker
from edge.recording.messages import Detections
from edge.ros.encode import encode_video
from edge.service.host import HostSample
from pipeline.detection.detector import ModelInfo
from pipeline.detection.errors import InferenceFailed
from pipeline.detection.layout import Layout
from pipeline.detections import FrameDetections
from tests.edge.recording.recording_scene import MS, FakeClock
from tests.edge.replay import videos
from tests.waiting import wait_for

TOPIC = Topics().video
COST_NS = 40 * MS


class Eye:
    """Sees one box in every image; looking takes some time."""

    info = ModelInfo("eye", "ab12", ("ailanthus",), "cpu", Layout.ROWS, (96, 160), demonstration=False)

    def __init__(self, clock, cost_ns=COST_NS) -> None:
        self.clock, self.cost_ns = clock, cost_ns
        self.seen: list[int] = []
        self.tired = False

    def detect(self, image_bgr, stamp_ns):
        self.clock.now_ns += self.cost_ns
        if self.tired:
            raise InferenceFailed("out of memory")
        self.seen.append(videos.index_of(image_bgr))
        return FrameDetections(
            *(stamp_ns, 160, 96, np.array([[1.0, 2, 30, 40]]), np.array([0.8]), np.zeros(1, int), self.info.class_names)
        )


class Bus:
    def __init__(self) -> None:
        self.waiting: list[Envelope] = []
        self.sent: list = []

    def receive(self, timeout_s):
        while self.waiting:
            yield self.waiting.pop(0)

    def send(self, result) -> None:
        self.sent.append(result)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


class Cool:
    temperature_c = 40.0

    def sample(self):
        return HostSample(0.0, 0.0, self.temperature_c, False, "", None)


def envelope(index: int, unit: bytes) -> Envelope:
    stamp_ns = index * videos.PERIOD_NS
    return Envelope(TOPIC, index, stamp_ns, stamp_ns, encode_video(VideoFrame(stamp_ns, 0, unit, False, 0), stamp_ns))


def watch(looker: Looker, clock: FakeClock, bus: Bus, units) -> None:
    """Units come in real time, and wait while the detector is busy."""
    units = list(units)
    while units:
        while units and units[0][0] * videos.PERIOD_NS <= clock.now_ns:
            bus.waiting.append(envelope(*units.pop(0)))
        looker.step(bus)
        clock.now_ns += 5 * MS


def made(config=None, cost_ns=COST_NS, probe=None) -> tuple[Looker, Eye, FakeClock, Bus]:
    clock = FakeClock(0)
    eye = Eye(clock, cost_ns)
    looker = Looker(
        config or Detection(rate_hz=2.0), eye, clock=clock, spent=lambda: clock.now_ns / 1e9, probe=probe or Cool()
    )
    return looker, eye, clock, Bus()


def test_two_images_a_second_are_looked_at_and_recorded_with_their_own_stamps():
    looker, eye, clock, bus = made()
    watch(looker, clock, bus, videos.units(120))
    assert [round(np.diff(eye.seen).mean()), len(eye.seen)] == [15, 8]
    assert all(isinstance(sent, Detections) for sent in bus.sent)
    assert [sent.stamp_ns for sent in bus.sent] == [index * videos.PERIOD_NS for index in eye.seen]
    (box,) = bus.sent[0].boxes
    assert (box.box_px, box.confidence, box.class_name) == ((1.0, 2.0, 30.0, 40.0), 0.8, "ailanthus")
    told = looker.state
    assert (told.state, told.model, told.device, told.looked, told.passed_over) == ("watching", "eye", "cpu", 8, 112)
    assert (told.rate_hz, told.boxes) == (pytest.approx(1.6), 2)
    assert 40.0 <= told.latency_ms < 80.0


def test_a_slow_model_sees_the_newest_image_and_never_a_backlog():
    looker, eye, clock, bus = made(Detection(rate_hz=2.0, core_share=1.0), cost_ns=1500 * MS)
    ages = []
    eye_detect = eye.detect

    def detect(image, stamp_ns):
        ages.append(clock.now_ns - stamp_ns)
        return eye_detect(image, stamp_ns)

    eye.detect = detect
    watch(looker, clock, bus, videos.units(400))
    assert max(ages[:-1]) < 2 * videos.PERIOD_NS  # while the last was waited for, the video ended
    assert len(eye.seen) == 400 // 45 + 2
    assert (looker.state.state, "takes 1.50 s of a core" in looker.state.note) == ("slowed", True)


def test_heat_slows_it_and_the_operator_is_told():
    class Hot(Cool):
        temperature_c = 80.0

    looker, eye, clock, bus = made(probe=Hot())
    clock.now_ns = 10_000 * MS
    watch(looker, clock, bus, [(300 + k, unit) for k, unit in videos.units(120)])
    assert len(eye.seen) == 4
    assert looker.state.note == "80 °C: 1.0 images/s"


def test_a_hole_costs_the_images_that_lean_on_it_and_nothing_else():
    looker, eye, clock, bus = made(Detection(rate_hz=1000.0, core_share=100.0), cost_ns=0)
    watch(looker, clock, bus, [unit for unit in videos.units(60) if unit[0] != 23])
    assert eye.seen == [*range(23), *range(30, 60)]


def test_silence_and_trouble_are_told():
    looker, eye, clock, bus = made()
    eye.tired = True
    watch(looker, clock, bus, videos.units(20))
    assert (looker.state.state, looker.state.note, bus.sent) == ("slowed", "out of memory", [])
    eye.tired = False
    watch(looker, clock, bus, [(20 + k, unit) for k, unit in videos.units(20)])
    assert looker.state.state == "watching"
    clock.now_ns += 3000 * MS
    looker.step(bus)
    assert (looker.state.state, looker.state.note) == ("waiting", "no video from the camera")


def test_a_message_that_is_no_video_is_borne():
    looker, eye, clock, bus = made()
    bus.waiting.append(Envelope(TOPIC, 1, 0, 0, b"\x00\x01\x00\x00junk"))
    looker.step(bus)
    watch(looker, clock, bus, videos.units(5))
    assert eye.seen == [0]


@pytest.fixture
def model(tmp_path):
    pytest.importorskip("onnxruntime", reason="the detector's runtime is an extra")
    pytest.importorskip("onnx", reason="models for tests are built with onnx")
    models = importlib.import_module("tests.pipeline.detection.models")
    return models.spotter(tmp_path / "spot.onnx", (96, 160))


def test_its_thread_looks_at_a_lower_priority_and_ends_when_told_to(model):
    bus, stop = Bus(), threading.Event()
    live = LiveDetection(Config(detection=Detection(model=str(model))), lambda topics: bus)
    assert live.state.state == "starting"
    live.start(stop)
    wait_for(lambda: live.state.state == "watching")
    thread = next(one for one in threading.enumerate() if one.name == "detection")
    own = os.getpriority(os.PRIO_PROCESS, 0)
    assert os.getpriority(os.PRIO_PROCESS, thread.native_id) == min(19, own + module.NICER)
    bus.waiting.append(envelope(*videos.units(1)[0]))
    wait_for(lambda: bus.sent)
    stop.set()
    live.join()
    assert not thread.is_alive()


def test_a_wrong_model_fails_in_words_and_alone(tmp_path):
    junk = tmp_path / "junk.onnx"
    junk.write_bytes(b"")
    live = LiveDetection(Config(detection=Detection(model=str(junk))), lambda topics: Bus())
    live.start(threading.Event())
    wait_for(lambda: live.state.state == "failed")
    assert "junk.onnx" in live.state.note
    live.join()
