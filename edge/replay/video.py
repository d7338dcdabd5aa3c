"""H.264 access units in, images out; what nobody wants, and nothing wanted leans on, is not decoded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import av
import numpy as np
import numpy.typing as npt
from av.video.reformatter import VideoReformatter

from drivers.gopro import h264
from drivers.gopro.references import References

Choose = Callable[[int], bool]
"""Whether the frame of this stamp is wanted; asked once for each that can be decoded, in order."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """stamp_ns: of its message, to the nanosecond. image_bgr: (height, width, 3) uint8."""

    stamp_ns: int
    image_bgr: npt.NDArray[np.uint8]


@dataclass(slots=True)
class VideoTally:
    """What came, and what could not be used. orphans: units before a key frame, or after a hole up to the next one."""

    units: int = 0
    decoded: int = 0
    images: int = 0
    orphans: int = 0
    holes: int = 0
    damaged: int = 0

    @property
    def told(self) -> tuple[str, ...]:
        """What is wrong, in words."""
        said = []
        if self.holes:
            said.append(f"{self.holes} holes in the video, where frames are missing")
        if self.damaged:
            said.append(f"{self.damaged} damaged frames in the video")
        if self.orphans:
            said.append(f"{self.orphans} frames of the video left out: before a first key frame, after holes or damage")
        return tuple(said)


class LazyDecoder:
    """Takes every access unit of a stream in order. Not thread-safe; decoding lets other threads run."""

    def __init__(self) -> None:
        self.tally = VideoTally()
        self._codec = _codec()
        self._reformatter = VideoReformatter()
        self._references = References()
        self._pending: list[tuple[int, bytes]] = []
        """Since the key frame, not decoded yet: number and data."""
        self._wanted: dict[int, int] = {}
        """Number -> stamp of the images that are still to come out."""
        self._broken = True
        """Until the next key frame."""
        self._parameters = b""
        """The last SPS and PPS: some streams have them once, and a new decoder needs them."""

    def add(self, stamp_ns: int, unit: bytes, choose: Choose) -> list[Frame]:
        """Take a unit (Annex B); the images that came out. Streams with reordered frames give them later."""
        number = self.tally.units
        self.tally.units += 1
        if not unit:  # would mean the end to the decoder
            self.tally.damaged += 1
            return []
        hole, kind = self._references.miss(unit), h264.kind(unit)
        frames: list[Frame] = []
        if kind.sps:
            self._parameters = h264.parameter_sets(unit)
        if kind.idr:
            frames = self.flush()
            self._broken = False
            unit = unit if kind.sps else self._parameters + unit
        elif hole and not self._broken:
            self.tally.holes += 1
            frames = self.flush()
            self._broken = True
        if self._broken:
            self.tally.orphans += 1
            return frames
        self._pending.append((number, unit))
        if choose(stamp_ns):
            self._wanted[number] = stamp_ns
        return frames + (self._decode_pending() if self._wanted else [])

    def flush(self) -> list[Frame]:
        """The images that still wait for later units: none will come. The next unit has to be a key frame."""
        frames = self._decoded(None) if self._wanted else []
        self._pending.clear()
        self._wanted.clear()
        self._codec.flush_buffers()
        return frames

    def _decode_pending(self) -> list[Frame]:
        frames = []
        pending, self._pending = self._pending, []
        for number, unit in pending:
            packet = av.Packet(unit)
            packet.pts = number
            frames += self._decoded(packet)
            if self._broken:
                break
        return frames

    def _decoded(self, packet: Any) -> list[Frame]:
        """packet: an `av.Packet`, None at the end."""
        try:
            found = self._codec.decode(packet)
        except av.error.FFmpegError:
            self._break()
            return []
        self.tally.decoded += len(found)
        if any(frame.is_corrupt for frame in found):
            self._break()
            return []
        wanted = [(self._wanted.pop(frame.pts), frame) for frame in found if frame.pts in self._wanted]
        self.tally.images += len(wanted)
        return [Frame(stamp_ns, self._image(frame)) for stamp_ns, frame in wanted]

    def _image(self, frame: av.VideoFrame) -> npt.NDArray[np.uint8]:
        return np.asarray(self._reformatter.reformat(frame, format="bgr24").to_ndarray(), np.uint8)

    def _break(self) -> None:
        self.tally.damaged += 1
        self._broken = True
        self._pending.clear()
        self._wanted.clear()
        self._codec = _codec()


def _codec() -> av.VideoCodecContext:
    codec = av.CodecContext.create("h264", "r")
    assert isinstance(codec, av.VideoCodecContext)
    codec.thread_count = 1  # several only delay the frames, and take the odometry's processor
    codec.options = {"err_detect": "explode"}  # rather no image than a smeared one
    return codec
