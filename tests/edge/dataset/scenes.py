"""Small datasets, pictures and recordings with video for the tests."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from drivers.messages import VideoFrame
from drivers.sim.video import RenderedVideo
from edge.dataset.folder import DatasetFolder, record_of
from edge.dataset.image import image_facts
from pipeline.dataset.labels import Box
from pipeline.gnss.geodesy import Datum
from tests.edge import live_recordings

S = 1_000_000_000
MS = 1_000_000
FRAME_NS = 100 * MS
DATUM = Datum(47.0, 8.0, 500.0)
SIZE = (96, 64)


def picture(seed: int, size: tuple[int, int] = SIZE, blur: float = 0.0) -> np.ndarray:
    """BGR, with structure of its own."""
    rng = np.random.default_rng(seed)
    coarse = cv2.resize(rng.random((5, 7, 3)), size, interpolation=cv2.INTER_CUBIC)
    fine = cv2.resize(rng.random((24, 32, 3)), size, interpolation=cv2.INTER_CUBIC)
    image = np.clip((0.6 * coarse + 0.4 * fine) * 255, 0, 255).astype(np.uint8)
    return cv2.GaussianBlur(image, (0, 0), blur) if blur else image


def png(seed: int, size: tuple[int, int] = SIZE) -> bytes:
    return cv2.imencode(".png", picture(seed, size))[1].tobytes()


def dataset(folder: Path, count: int = 4, classes: tuple[str, ...] = ("ailanthus",), **fields) -> DatasetFolder:
    """Pictures p0.png, p1.png, ... without labels."""
    made = DatasetFolder.make(folder)
    made.classes = list(classes)
    for k in range(count):
        data = png(k)
        made.add(record_of(f"p{k}.png", image_facts(data, "p"), **fields), data)
    made.save()
    return made


def label(made: DatasetFolder, **labels: list[Box]) -> None:
    """By the names without ending."""
    for record in made.records:
        if record.stem in labels:
            made.set_labels(record, labels[record.stem])


BOX = Box(0, 0.5, 0.5, 0.2, 0.4)
OTHER = Box(0, 0.25, 0.25, 0.125, 0.25)


class _Walk:
    """A new scene every metre, of which every fifth frame is in focus."""

    def __init__(self, speed_m_s: float) -> None:
        self._along_m = speed_m_s * FRAME_NS / S
        self._index = -1

    def render(self, t_ns: int) -> np.ndarray:
        self._index += 1
        seed = int(self._index * self._along_m + 1e-6)
        return cv2.cvtColor(picture(seed, blur=0.0 if self._index % 5 == 2 else 1.5), cv2.COLOR_BGR2RGB)


def video(frames: int, speed_m_s: float = 1.0) -> list[VideoFrame]:
    """Ten frames a second, a key frame every thirtieth."""
    source = RenderedVideo(_Walk(speed_m_s), *SIZE)
    units = [source.access_unit(k) for k in range(frames)]
    return [VideoFrame(k * FRAME_NS, k * FRAME_NS + MS, data, key, k * 9000) for k, (data, key) in enumerate(units)]


def poses(start_s: float, end_s: float, speed_m_s: float = 1.0) -> list:
    """What a live pipeline says of a walk to the north, ten times a second."""
    told = []
    for k in range(round(start_s * 10), round(end_s * 10) + 1):
        at = np.array([0.0, speed_m_s * k * 0.1, 0.0])
        told += live_recordings.told(
            k * FRAME_NS, Rotation.identity().as_matrix(), np.eye(6) * 0.01, odom_m=at, map_m=at, datum=DATUM
        )
    return told


def record(root: Path, *streams: list) -> Path:
    """A session of these messages, in order of time."""
    messages = sorted((message for stream in streams for message in stream), key=lambda message: message.stamp_ns)
    return live_recordings.record(root, messages)
