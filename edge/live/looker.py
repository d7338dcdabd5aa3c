"""The newest image of the camera through the detector, never a backlog."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Protocol

from edge.bus.envelope import Envelope
from edge.bus.results import Result
from edge.config import Detection
from edge.control.messages import Detecting
from edge.errors import FormatError
from edge.live.pace import Pace
from edge.recording.messages import DetectedBox, Detections
from edge.replay.video import Frame, LazyDecoder
from edge.ros.decode import CompressedVideo, decode_video
from edge.service.host import HostProbe
from pipeline.detection.detector import Image, ModelInfo
from pipeline.detection.errors import InferenceFailed
from pipeline.detections import FrameDetections

log = logging.getLogger(__name__)

WAIT_S = 0.1
SILENT_S = 2.0
"""Without video for so long, the operator is told."""
FEEL_S = 2.0
RATE_OVER_S = 5.0
MOST_FOUND = 16


class Bus(Protocol):
    """`BusClient`, as far as it is used here."""

    def receive(self, timeout_s: float) -> Iterator[Envelope]: ...
    def send(self, result: Result) -> None: ...


class Eye(Protocol):
    """`Detector`, as far as it is used here."""

    @property
    def info(self) -> ModelInfo: ...
    def detect(self, image_bgr: Image, stamp_ns: int) -> FrameDetections: ...


class Looker:
    """`step` again and again, in one thread; `state` may be read from any."""

    def __init__(
        self,
        config: Detection,
        eye: Eye,
        *,
        clock: Callable[[], int] = time.monotonic_ns,
        spent: Callable[[], float] = time.thread_time,
        probe: HostProbe | None = None,
    ) -> None:
        """spent: processor time of this thread, seconds."""
        self._eye = eye
        self._clock, self._spent = clock, spent
        self._cores = max(config.threads, 1) if eye.info.device == "cpu" else 1
        """That are busy while this thread is."""
        self._probe = probe or HostProbe()
        self._pace = Pace(config.rate_hz, config.core_share, config.hot_c)
        self._decoder = LazyDecoder()
        self._looks: deque[tuple[int, int]] = deque()
        """When, and how many boxes there were."""
        self._looked, self._latency_ns = 0, 0
        self._arrived_ns, self._felt_ns = clock(), 0
        self._problem = ""
        self.found: deque[FrameDetections] = deque(maxlen=MOST_FOUND)
        """Images that were looked at, for whoever takes them; `popleft` from any thread."""
        self.state = self._told()

    def step(self, bus: Bus) -> None:
        """Everything that came is taken in; the last of it is looked at when it is time to."""
        videos = self._arrived(bus)
        began_ns, began_s = self._clock(), self._spent()
        if began_ns - self._felt_ns > FEEL_S * 1e9:
            self._felt_ns, sample = began_ns, self._probe.sample()
            self._pace.feel(sample.temperature_c, throttled=sample.throttled)
        newest = None
        for number, video in enumerate(videos, 1):
            due = number == len(videos) and self._pace.due(began_ns)
            for frame in self._decoder.add(video.stamp_ns, video.data, _wanted if due else _not_wanted):
                newest = frame
        if newest is not None:
            self._look(newest, bus)
            self._pace.looked(began_ns, (self._spent() - began_s) * self._cores)
        self.state = self._told()

    def _arrived(self, bus: Bus) -> list[CompressedVideo]:
        envelopes = list(bus.receive(WAIT_S))
        while more := list(bus.receive(0.0)):
            envelopes += more
        found = []
        for envelope in envelopes:
            try:
                found.append(decode_video(envelope.data))
            except FormatError as error:  # the recording has it as it came
                self._problem = str(error)
        if found:
            self._arrived_ns = self._clock()
        return found

    def _look(self, frame: Frame, bus: Bus) -> None:
        try:
            found = self._eye.detect(frame.image_bgr, frame.stamp_ns)
        except InferenceFailed as error:
            log.warning("%s", error)
            self._problem = str(error)
            return
        now_ns = self._clock()
        bus.send(message(found, now_ns))
        self.found.append(found)
        self._problem = ""
        self._looked += 1
        self._latency_ns = now_ns - frame.stamp_ns
        self._looks.append((now_ns, len(found)))

    def _told(self) -> Detecting:
        info, now_ns = self._eye.info, self._clock()
        while self._looks and now_ns - self._looks[0][0] > RATE_OVER_S * 1e9:
            self._looks.popleft()
        silent = now_ns - self._arrived_ns > SILENT_S * 1e9
        slow = self._pace.note
        return Detecting(
            state="waiting" if silent else "slowed" if self._problem or slow else "watching",
            model=info.name,
            sha256=info.sha256,
            device=info.device,
            rate_hz=len(self._looks) / RATE_OVER_S,
            latency_ms=self._latency_ns / 1e6,
            boxes=sum(boxes for at_ns, boxes in self._looks if now_ns - at_ns <= 1e9),
            looked=self._looked,
            passed_over=self._decoder.tally.units - self._looked,
            note=self._problem or ("no video from the camera" if silent else slow or info.notice),
        )


def _wanted(_stamp_ns: int) -> bool:
    return True


def _not_wanted(_stamp_ns: int) -> bool:
    return False


def message(found: FrameDetections, now_ns: int) -> Detections:
    """As it is recorded, an empty one too."""
    boxes = zip(found.boxes_px.tolist(), found.confidence.tolist(), found.class_id.tolist(), strict=True)
    held = tuple(DetectedBox(tuple(box), score, found.class_names[number]) for box, score, number in boxes)
    return Detections(found.stamp_ns, now_ns, held)
