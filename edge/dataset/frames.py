"""Frames of a recording into a dataset: of each stretch of way the sharpest."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import msgspec

from edge.config import Config
from edge.dataset.folder import DatasetFolder
from edge.dataset.image import digest
from edge.dataset.way import NoWay, Way, find_way
from edge.errors import EdgeError, FormatError
from edge.process.process import Task
from edge.recording.folder import safe_name
from edge.replay.frames import VideoFrames, video_topic
from edge.replay.store import MessageStore
from edge.ros import schemas
from pipeline.dataset.choose import Candidate, Chosen, Tally, choose
from pipeline.dataset.record import ImageRecord

_STAMPED = re.compile(r"^\d{8}T\d{6}Z_")
_LONGEST_NAME = 120


@dataclass(frozen=True, slots=True)
class FramesTask:
    """session: a session's folder, or a file. site: empty takes the mission's name. quality: of the JPEGs, 1 to 100.

    every_m: length of the stretches; every_s: the same in time, where there are no poses.
    """

    session: Path
    site: str = ""
    every_m: float = 2.0
    every_s: float = 2.0
    quality: int = 95
    least_sharpness: float = 0.0


class FramesReport(msgspec.Struct):
    """chosen_by: distance, or time without poses. seen: frames looked at; outside: before and after the poses."""

    session: str
    site: str
    chosen_by: str
    poses: str
    """Where they are from, or why there are none."""
    quality: int
    seen: int = 0
    outside: int = 0
    added: int = 0
    already: int = 0
    """Chosen, and in the dataset from an earlier run."""
    alike: int = 0
    blurred: int = 0
    placed: int = 0
    lost: int = 0
    travelled_m: float = 0.0


def extract(task: FramesTask, config: Config, dataset: DatasetFolder, advance: Callable[[float], None]) -> FramesReport:
    """Add the frames; `dataset.save` is left to the caller. FormatError for a recording without video."""
    store = MessageStore([task.session])
    session = Task([task.session]).session
    site = task.site or _STAMPED.sub("", session)
    way = find_way([task.session], config)
    by, told = ("distance", way.origin) if isinstance(way, Way) else ("time", way.why)
    report = FramesReport(session, site, by, told, task.quality)
    return _Extraction(task, store, config, dataset, way, report).run(advance)


@dataclass
class _Extraction:
    task: FramesTask
    store: MessageStore
    config: Config
    dataset: DatasetFolder
    way: Way | NoWay
    report: FramesReport

    def run(self, advance: Callable[[float], None]) -> FramesReport:
        tally, report = Tally(), self.report
        there = {record.image: record for record in self.dataset.records}
        known = [r.phash for r in self.dataset.records if r.session != report.session and r.phash]
        stretch = self.task.every_m if isinstance(self.way, Way) else self.task.every_s
        least = self.task.least_sharpness
        for chosen in choose(self._candidates(advance), stretch, tally, least_sharpness=least, known=known):
            name = _name(report.session, chosen.candidate.stamp_ns)
            if name in there:
                report.already += 1
            else:
                self._add(name, chosen)
        report.seen, report.alike, report.blurred = tally.seen, tally.alike, tally.blurred
        report.travelled_m = float(self.way.travelled_m[-1]) if isinstance(self.way, Way) else 0.0
        if not tally.seen:
            raise FormatError(f"{report.session}: none of {report.lost + report.outside} frames of video can be used")
        return report

    def _candidates(self, advance: Callable[[float], None]) -> Iterator[Candidate]:
        topic = video_topic(self.store.topics, self.store.recording.effective(self.config).topics)
        count = self.store.count(topic) if topic else 0
        if not count:
            raise FormatError(f"{self.store.recording.name}: no video in this recording: {_why_not(topic)}")
        frames = VideoFrames(self.store, topic)
        start_ns: int | None = None
        for frame in frames.read(self._wanted):
            stamp_ns = frame.stamp_ns
            advance(frames.tally.units / count)
            start_ns = stamp_ns if start_ns is None else start_ns
            along = self.way.along_m(stamp_ns) if isinstance(self.way, Way) else (stamp_ns - start_ns) / 1e9
            yield Candidate(stamp_ns, along, frame.image_bgr)
        self.report.lost = frames.tally.orphans + frames.tally.damaged + frames.unreadable

    def _wanted(self, stamp_ns: int) -> bool:
        if isinstance(self.way, NoWay) or self.way.covers(stamp_ns):
            return True
        self.report.outside += 1
        return False

    def _add(self, name: str, chosen: Chosen) -> None:
        stamp_ns, image = chosen.candidate.stamp_ns, chosen.candidate.image
        done, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self.task.quality])
        if not done:
            raise EdgeError(f"{name}: the JPEG encoder refused an image of {image.shape}")
        data = jpeg.tobytes()
        place = self.way.place(stamp_ns) if isinstance(self.way, Way) else None
        latitude, longitude, height = place or (None, None, None)
        record = ImageRecord(
            image=name,
            sha256=digest(data),
            width_px=image.shape[1],
            height_px=image.shape[0],
            source="field",
            site=self.report.site,
            session=self.report.session,
            stamp_ns=stamp_ns,
            travelled_m=round(chosen.candidate.along, 3) if isinstance(self.way, Way) else None,
            latitude_deg=latitude,
            longitude_deg=longitude,
            height_m=height,
            sharpness=round(chosen.sharpness, 3),
            phash=chosen.phash,
            jpeg_quality=self.task.quality,
            chosen_by=self.report.chosen_by,
        )
        self.dataset.add(record, data)
        self.report.added += 1
        self.report.placed += place is not None


def _why_not(topic: str) -> str:
    return "the camera gave none" if topic else f"there is no topic of type {schemas.COMPRESSED_VIDEO}"


def _name(session: str, stamp_ns: int) -> str:
    return f"{safe_name(session)[:_LONGEST_NAME]}_{stamp_ns}.jpg"
