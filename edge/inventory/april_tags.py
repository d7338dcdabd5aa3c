"""AprilTags in the video of a session, as rays on its map."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from edge.config import Config
from edge.errors import FormatError
from edge.process import fusion_stage, odometry_stage
from edge.process.ahead import ahead
from edge.process.camera_way import CameraWay
from edge.process.fusion_stage import read_placement
from edge.process.places import Places
from edge.replay.frames import VideoFrames, every, video_topic
from edge.replay.replay import Replay
from edge.replay.rig import camera_rig, recorded_calibration
from edge.replay.store import MessageStore
from edge.replay.video import Frame
from pipeline.inventory.april_tags import Sighting, TagReader, sightings
from pipeline.products.track import read_track

RATE_HZ = 5.0
_DEPTH = 3
"""Images decoded ahead."""


def read_april_tags(
    recording: Sequence[Path], places: Places, config: Config, advance: Callable[[float], None]
) -> tuple[list[Sighting], tuple[str, ...]]:
    """Where they are in the frame of the session's map, and what has to be said."""
    store = MessageStore(recording)
    topic = video_topic(store.topics, store.recording.effective(config).topics)
    if not topic or not store.count(topic):
        return [], ("there is no video in the recording: no AprilTags were read",)
    replay = Replay(recording, config)
    calibration = recorded_calibration(replay.facts, config.calibration)
    rig = camera_rig(calibration, replay.static_transforms, config.calibration)
    path, track = places.fusion / fusion_stage.PLACEMENT, read_track(places.odometry / odometry_stage.TRACK)
    way = CameraWay(track, read_placement(path) if path.exists() else None, rig)
    frames = VideoFrames(store, topic)
    start_ns, end_ns = frames.span_ns
    try:
        images = ahead(frames.read(every(1.0 / RATE_HZ)), _DEPTH)
        return look(images, way, lambda ns: advance(max(0.0, (ns - start_ns) / max(end_ns - start_ns, 1)))), frames.told
    except FormatError as error:
        return [], (str(error),)


def look(frames: Iterable[Frame], way: CameraWay, at_ns: Callable[[int], None]) -> list[Sighting]:
    """What the images show of tags. at_ns: told the stamp of each."""
    reader, found = TagReader(), []
    for frame in frames:
        height, width = frame.image_bgr.shape[:2]
        placed = way.view(frame.stamp_ns, width, height)
        if placed is not None:
            found += sightings(reader.read(frame.image_bgr), way.on_map(*placed))
        at_ns(frame.stamp_ns)
    return found
