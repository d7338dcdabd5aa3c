"""Pictures to calibrate from: image files, folders of them, videos, and recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import cv2
import numpy as np
import numpy.typing as npt

from edge.calibration.recording import CalibrationRecording
from edge.config import Config
from edge.errors import FormatError
from edge.replay.frames import every

Image = npt.NDArray[np.uint8]
IMAGES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff"})
VIDEOS = frozenset({".mp4", ".mov", ".mkv", ".ts", ".avi", ".lrv", ".h264"})


@dataclass(frozen=True, slots=True, eq=False)
class NamedPicture:
    """moving: one of a video, so that the next is alike."""

    name: str
    image_bgr: Image
    moving: bool


def pictures(
    sources: Sequence[Path], config: Config, every_s: float, advance: Callable[[float], None]
) -> Iterator[NamedPicture]:
    """In order; of videos one each `every_s`. FormatError for what cannot be opened."""
    for number, source in enumerate(sources):

        def told(share: float, number: int = number) -> None:
            advance((number + share) / len(sources))

        yield from _one(source, config, every_s, told)


def _one(source: Path, config: Config, every_s: float, advance: Callable[[float], None]) -> Iterator[NamedPicture]:
    if not source.exists():
        raise FormatError(f"{source}: there is no such file or folder")
    files = sorted(path for path in source.iterdir() if path.suffix.lower() in IMAGES) if source.is_dir() else []
    if source.suffix.lower() in IMAGES:
        files = [source]
    if files:
        yield from _images(files, advance)
    elif source.suffix.lower() in VIDEOS:
        yield from _video(source, every_s, advance)
    else:
        yield from _recording(source, config, every_s, advance)


def _images(files: Sequence[Path], advance: Callable[[float], None]) -> Iterator[NamedPicture]:
    for number, path in enumerate(files):
        image = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if image is None:
            raise FormatError(f"{path}: not a picture that can be read")
        yield NamedPicture(path.name, np.asarray(image, np.uint8), moving=False)
        advance((number + 1) / len(files))


def _video(path: Path, every_s: float, advance: Callable[[float], None]) -> Iterator[NamedPicture]:
    wanted = every(every_s)
    try:
        with av.open(str(path)) as container:
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            length_s = (container.duration or 0) / av.time_base
            for frame in container.decode(stream):
                at_s = float(frame.time or 0.0)
                if wanted(round(at_s * 1e9)):
                    image = np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)
                    yield NamedPicture(f"{path.name} at {at_s:.2f} s", image, moving=True)
                    advance(at_s / length_s if length_s else 0.0)
    except (av.error.FFmpegError, IndexError) as error:
        raise FormatError(f"{path}: not a video that can be read ({error})") from error


def _recording(
    source: Path, config: Config, every_s: float, advance: Callable[[float], None]
) -> Iterator[NamedPicture]:
    recording = CalibrationRecording(source, config)
    first_ns, last_ns = recording.video_span_ns()
    for stamp_ns, image in recording.images(every(every_s)):
        yield NamedPicture(f"{recording.name} at {(stamp_ns - first_ns) * 1e-9:.2f} s", image, moving=True)
        advance((stamp_ns - first_ns) / max(last_ns - first_ns, 1))
