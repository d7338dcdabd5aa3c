"""A GoPro's files: chapters of one recording, and the gyroscope in them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
import numpy.typing as npt

from drivers.errors import ProtocolError
from drivers.gopro.gpmf import Samples, samples
from edge.errors import FormatError
from pipeline.calibration.turning import Turning, of_gyro

_NAME = re.compile(r"^G[HX](\d{2})(\d{4})\.(MP4|LRV)$", re.IGNORECASE)
_GYRO = "GYRO"
_FRAMES = ("SHUT", "CORI", "ISOE")
"""One a frame: their clock reading is that of the first frame."""
_TELEMETRY = "GoPro MET"


@dataclass(frozen=True, slots=True, eq=False)
class Chapter:
    """One file. times_s, rate: (n,), (n, 3) of the gyroscope, from its first frame. size: 0 where it has no picture."""

    path: Path
    duration_s: float
    width_px: int
    height_px: int
    created: str
    firmware: str
    times_s: npt.NDArray[np.float64]
    rate: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Payload:
    """One piece of the telemetry track, with its place in the file."""

    begin_s: float
    duration_s: float
    data: bytes


def in_order(paths: Iterable[Path]) -> list[list[Path]]:
    """Recordings, each as its chapters: GH010042.MP4, GH020042.MP4, ... FormatError for files that are not there."""
    recordings: dict[str, list[tuple[int, Path]]] = {}
    for path in sorted(_files(paths)):
        found = _NAME.match(path.name)
        number, key = (int(found[1]), f"{path.parent}/{found[2]}") if found else (0, str(path))
        recordings.setdefault(key, []).append((number, path))
    return [[path for _, path in sorted(chapters)] for chapters in recordings.values()]


def _files(paths: Iterable[Path]) -> Iterable[Path]:
    for path in paths:
        if path.is_dir():
            inside = [one for one in path.iterdir() if (m := _NAME.match(one.name)) and m[3].upper() == "MP4"]
            if not inside:
                raise FormatError(f"{path}: no files named as a GoPro does (GH010042.MP4, GX010042.MP4)")
            yield from inside
        elif path.is_file():
            yield path
        else:
            raise FormatError(f"{path}: there is no such file or folder")


def read_chapter(path: Path) -> Chapter:
    """FormatError for a file that cannot be read, or has no gyroscope."""
    try:
        with av.open(str(path)) as container:
            tracks = [one for one in container.streams if _TELEMETRY in one.metadata.get("handler_name", "")]
            if not tracks:
                raise FormatError(
                    f"{path}: no GoPro telemetry in it; give the file as it was on the camera's card: copies by "
                    "phone apps and editors lose the track"
                )
            base = float(tracks[0].time_base or 0)
            payloads = [
                Payload((packet.pts or 0) * base, (packet.duration or 0) * base, bytes(packet))
                for packet in container.demux(tracks[0])
                if packet.size
            ]
            picture = container.streams.video[0] if container.streams.video else None
            duration = picture or tracks[0]
            length_s = float((duration.duration or 0) * (duration.time_base or 0))
            size = (picture.width, picture.height) if picture is not None else (0, 0)
            told = container.metadata
    except av.error.FFmpegError as error:
        raise FormatError(f"{path}: not a video that can be read ({error})") from error
    try:
        times, rate = gyro(payloads)
    except ProtocolError as error:
        raise FormatError(f"{path}: {error}") from error
    if not len(times):
        raise FormatError(f"{path}: its telemetry has no gyroscope; is it of a photo mode, or time lapse?")
    return Chapter(path, length_s, *size, told.get("creation_time", ""), told.get("firmware", ""), times, rate)


def gyro(payloads: Sequence[Payload]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Times (n,) from the first frame, and rates (n, 3) in rad/s, in the order of axes of the camera.

    By the camera's clock where it is told: a straight line through the readings, for one payload's is 1 ms off; the
    sensor's rate is up to 1 % from nominal, so samples are counted. Else by the place of the payloads in the file.
    """
    parts: list[tuple[Payload, Samples]] = []
    frame_us: int | None = None
    for payload in payloads:
        for one in samples(payload.data, frozenset((_GYRO, *_FRAMES))):
            if one.name == _GYRO and len(one.values):
                parts.append((payload, one))
            elif one.name != _GYRO and frame_us is None:
                frame_us = one.first_us
    if not parts:
        return np.empty(0), np.empty((0, 3))
    rate = np.vstack([one.values[:, :3] for _, one in parts])
    counts = np.array([len(one.values) for _, one in parts])
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    clock = [one.first_us for _, one in parts]
    if frame_us is None or any(reading is None for reading in clock):
        begins = np.array([payload.begin_s for payload, _ in parts])
    else:
        begins = (np.array(clock, np.float64) - frame_us) * 1e-6
    if len(parts) == 1:
        step = parts[0][0].duration_s / counts[0]
        return begins[0] + step * np.arange(counts[0]), rate
    slope, start = np.polyfit(first, begins, 1)
    return start + slope * np.arange(counts.sum()), rate


def turning(chapters: Sequence[Chapter], begin_ns: int) -> tuple[Turning, list[float]]:
    """Of all chapters, one after the other, the first frame being at begin_ns; and when each begins (s after that)."""
    starts = np.concatenate([[0.0], np.cumsum([chapter.duration_s for chapter in chapters])[:-1]])
    times = np.concatenate([start + chapter.times_s for start, chapter in zip(starts, chapters, strict=True)])
    rate = np.vstack([chapter.rate for chapter in chapters])
    return of_gyro(begin_ns + np.round(times * 1e9).astype(np.int64), rate), starts.tolist()
