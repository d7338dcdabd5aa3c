"""The simulated camera's video: rendered pictures as H.264, one access unit a frame."""

from __future__ import annotations

from fractions import Fraction
from typing import Protocol

import av
import cv2
import numpy as np
import numpy.typing as npt

from drivers.errors import SimulationError
from drivers.sim.camera import FRAME_DENOMINATOR, FRAME_NUMERATOR, exposure_ns

GROUP_OF_PICTURES = 30
BITS_PER_S = 3_000_000


class Pictures(Protocol):
    """Renders a frame."""

    def render(self, t_ns: int) -> npt.NDArray[np.uint8]:
        """RGB (h, w, 3)."""


class RenderedVideo:
    """A `VideoSource`: a frame is rendered when it is asked for, in order, and encoded without delay."""

    def __init__(self, renderer: Pictures, width_px: int, height_px: int) -> None:
        self._renderer = renderer
        self._encoder = _encoder(width_px, height_px)
        self._last = -1

    def access_unit(self, index: int) -> tuple[bytes, bool]:
        """Annex B, SPS and PPS before each keyframe. SimulationError when frames are asked for out of order."""
        if index <= self._last:
            raise SimulationError(f"video frame {index} asked for after {self._last}: frames are made in order")
        self._last = index
        rgb = self._renderer.render(exposure_ns(index))
        planes = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2YUV_I420), dtype=np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts = index
        packets = self._encoder.encode(frame)
        if len(packets) != 1:
            raise SimulationError(f"the encoder gave {len(packets)} packets for frame {index}: it must not delay")
        return bytes(packets[0]), bool(packets[0].is_keyframe)


def _encoder(width_px: int, height_px: int) -> av.VideoCodecContext:
    encoder = av.CodecContext.create("libx264", "w")
    assert isinstance(encoder, av.VideoCodecContext)
    encoder.width, encoder.height, encoder.pix_fmt = width_px, height_px, "yuv420p"
    encoder.time_base = Fraction(FRAME_NUMERATOR, FRAME_DENOMINATOR)
    encoder.framerate = Fraction(FRAME_DENOMINATOR, FRAME_NUMERATOR)
    encoder.bit_rate = BITS_PER_S
    encoder.gop_size = GROUP_OF_PICTURES
    encoder.thread_count = 1  # the same bytes on every machine, and no more than its share of the cores
    encoder.options = {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "x264-params": "annexb=1:repeat-headers=1:scenecut=0:aud=1",
    }
    return encoder
