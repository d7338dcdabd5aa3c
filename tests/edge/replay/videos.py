"""Streams of H.264 whose frames say which they are."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

import av
import numpy as np

GROUP = 10
PERIOD_NS = 33_366_667
SIZE_PX = (96, 160)
_BITS, _BLOCK = 10, 16
_PLAIN = {"tune": "zerolatency", "x264-params": "annexb=1:repeat-headers=1:scenecut=0:aud=1"}
REORDERED = {"bf": "2", "x264-params": "annexb=1:repeat-headers=1:scenecut=0:b-adapt=0:bframes=2"}


def picture(index: int) -> np.ndarray:
    """BGR; the index in bars, black and white."""
    bars = np.repeat([255 * (index >> bit & 1) for bit in range(_BITS)], _BLOCK).astype(np.uint8)
    return np.ascontiguousarray(np.broadcast_to(bars[None, :, None], (*SIZE_PX, 3)))


def index_of(image: np.ndarray) -> int:
    """Which one it is."""
    bars = image[:, : _BITS * _BLOCK].reshape(SIZE_PX[0], _BITS, _BLOCK, 3).mean(axis=(0, 2, 3))
    return sum(1 << bit for bit in range(_BITS) if bars[bit] > 127)


def noise(seed: int, count: int) -> list[np.ndarray]:
    """Pictures that take many bytes."""
    rng = np.random.default_rng(seed)
    return [rng.integers(0, 256, (*SIZE_PX, 3), np.uint8) for _ in range(count)]


def units(count: int, options: dict[str, str] | None = None) -> list[tuple[int, bytes]]:
    """(number of the frame, access unit) in order of decoding."""
    return encoded(map(picture, range(count)), options)


def encoded(pictures: Iterable[np.ndarray], options: dict[str, str] | None = None) -> list[tuple[int, bytes]]:
    """The same of other pictures, all of one size."""
    encoder = None
    found = []
    for index, image in enumerate(pictures):
        encoder = encoder or _encoder(image.shape[:2], options)
        frame = av.VideoFrame.from_ndarray(image, format="bgr24")
        frame.pts = index
        found += [(packet.pts, bytes(packet)) for packet in encoder.encode(frame)]
    return found + [(packet.pts, bytes(packet)) for packet in encoder.encode(None)]


def _encoder(size_px, options):
    encoder = av.CodecContext.create("libx264", "w")
    encoder.height, encoder.width = size_px
    encoder.pix_fmt, encoder.time_base, encoder.gop_size = "yuv420p", Fraction(1, 30), GROUP
    encoder.thread_count = 1
    encoder.options = {"preset": "ultrafast", "crf": "5", **(options or _PLAIN)}
    return encoder
