"""What emulated sensors see in tests: a way east, and pictures small enough to be encoded at once."""

from __future__ import annotations

from functools import cache

import av
import numpy as np

from drivers.sim.gnss_geodesy import Datum
from drivers.sim.sources import GnssEpoch

DATUM = Datum()


class Eastward:
    """A fixed position that moves east at 1 m/s: the walk's time can be read back from it."""

    def epoch(self, t_ns: int) -> GnssEpoch:
        latitude, longitude, height = DATUM.geodetic((t_ns / 1e9, 0.0, 0.0))
        return GnssEpoch(latitude, longitude, height, 48.1, 4, 20, 0.7, 1.2, (0.011, 0.012, 0.02), 1.0, 90.0)


@cache
def tiny_units(count: int = 60, size: int = 64, gop: int = 10) -> tuple[bytes, ...]:
    """H.264 access units in Annex B with parameter sets before each IDR, encoded by PyAV, each unlike the others."""
    codec = av.CodecContext.create("libx264", "w")
    codec.width = codec.height = size
    codec.pix_fmt = "yuv420p"
    codec.framerate = 30
    codec.gop_size = gop
    codec.max_b_frames = 0
    x264 = "repeat-headers=1:scenecut=0:threads=1"  # one thread: the same bytes in every process
    codec.options = {"preset": "ultrafast", "tune": "zerolatency", "x264-params": x264}
    pixels = np.random.default_rng(1)
    packets = []
    for index in range(count):
        image = np.full((size, size, 3), index * 4 % 256, np.uint8)
        image[: size // 2] = pixels.integers(0, 256, (size // 2, size, 3), np.uint8)
        packets += codec.encode(av.VideoFrame.from_ndarray(image, "rgb24"))
    packets += codec.encode(None)
    return tuple(bytes(packet) for packet in packets)
