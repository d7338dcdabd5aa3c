"""Images out of the video of a recording, in order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import av
import numpy as np
import numpy.typing as npt

from drivers.gopro import h264
from edge.config import Topics
from edge.errors import FormatError
from edge.replay.store import MessageStore
from edge.ros import schemas
from edge.ros.decode import decode_video

Image = npt.NDArray[np.uint8]


@dataclass(slots=True)
class VideoTally:
    """lost: access units that could not be decoded, or came before a key frame."""

    units: int = 0
    lost: int = 0


def video_topic(store: MessageStore, names: Topics) -> str:
    """By name where the configuration's is there, else by type. FormatError where there is no frame of any."""
    video = [name for name, topic in store.topics.items() if topic.type_name == schemas.COMPRESSED_VIDEO]
    found = [name for name in video if store.count(name)]
    if not found:
        why = "the camera gave none" if video else f"there is no topic of type {schemas.COMPRESSED_VIDEO}"
        raise FormatError(f"{store.recording.name}: no video in this recording, {why}")
    return names.video if names.video in found else min(found)


def read_frames(
    store: MessageStore, topic: str, wanted: Callable[[int], bool], tally: VideoTally
) -> Iterator[tuple[int, Image]]:
    """Stamp and image (h, w, 3) BGR of the frames that are wanted. FormatError for a video that is not H.264."""
    codec = _codec()
    stamps: dict[int, int] = {}
    broken = True

    def images(decoded: list[av.VideoFrame]) -> Iterator[tuple[int, Image]]:
        for frame in decoded:
            stamp_ns = stamps.pop(frame.pts or 0)
            if not frame.is_corrupt and wanted(stamp_ns):
                yield stamp_ns, np.asarray(frame.to_ndarray(format="bgr24"), np.uint8)

    for raw in store.messages({topic}):
        video = decode_video(raw.data)
        if video.format != "h264":
            raise FormatError(f"{topic}: its video is {video.format!r}, only 'h264' can be decoded")
        number, tally.units = tally.units, tally.units + 1
        broken = broken and not h264.kind(video.data).entry
        if broken or not video.data:
            tally.lost += 1
            continue
        stamps[number] = video.stamp_ns
        packet = av.Packet(video.data)
        packet.pts = number
        try:
            decoded = codec.decode(packet)
        except av.error.FFmpegError:
            tally.lost += 1
            codec, broken = _codec(), True
            continue
        yield from images(decoded)
    yield from images(codec.decode(None))


def _codec() -> av.VideoCodecContext:
    codec = av.CodecContext.create("h264", "r")
    assert isinstance(codec, av.VideoCodecContext)
    codec.options = {"err_detect": "explode"}  # rather no image than a smeared one
    return codec
