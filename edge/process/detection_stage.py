"""Between fusion and products: the detector over the session's video, where there is one."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from edge.config import Config
from edge.errors import FormatError
from edge.process.ahead import ahead
from edge.process.detections_file import DETECTIONS, FACTS, DetectionFacts, ModelFacts, write_detections
from edge.replay.frames import VideoFrames, every, video_topic
from edge.replay.store import MessageStore
from pipeline.detection.detector import Detector
from pipeline.detections import FrameDetections

_DEPTH = 3
"""Images decoded ahead."""


@dataclass(frozen=True, slots=True)
class DetectionStage:
    """targets: the recording."""

    targets: Sequence[Path]
    config: Config
    detector: Detector

    def run(self, folder: Path, advance: Callable[[float], None]) -> DetectionFacts:
        """advance: told the share that is done."""
        facts, started_s = DetectionFacts(self._model()), time.monotonic()
        if notice := self.detector.info.notice:
            facts.notes = (notice,)
        store = MessageStore(self.targets)
        topic = video_topic(store.topics, store.recording.effective(self.config).topics)
        found: list[FrameDetections] = []
        if not topic or not store.count(topic):
            facts.notes += ("there is no video in the recording: nothing was looked at",)
        else:
            frames = VideoFrames(store, topic)
            try:
                found = self._look(frames, advance)
            except FormatError as error:
                facts.notes += (str(error),)
            facts.notes += frames.told
        facts.images, facts.boxes = len(found), sum(map(len, found))
        facts.seconds = time.monotonic() - started_s
        write_detections(folder / DETECTIONS, facts.model, topic, found)
        (folder / FACTS).write_bytes(msgspec.json.encode(facts))
        return facts

    def _look(self, frames: VideoFrames, advance: Callable[[float], None]) -> list[FrameDetections]:
        start_ns, end_ns = frames.span_ns
        found = []
        for frame in ahead(frames.read(every(1.0 / self.config.detection.rate_hz)), _DEPTH):
            found.append(self.detector.detect(frame.image_bgr, frame.stamp_ns))
            advance(max(0.0, (frame.stamp_ns - start_ns) / max(end_ns - start_ns, 1)))
        return found

    def _model(self) -> ModelFacts:
        info = self.detector.info
        return ModelFacts(
            info.name,
            info.sha256,
            info.class_names,
            info.device,
            self.detector.confidence,
            self.detector.iou,
            info.demonstration,
        )
