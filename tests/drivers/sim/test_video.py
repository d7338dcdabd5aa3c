import io

import av
import numpy as np
import pytest

from drivers.errors import SimulationError
from drivers.sim.video import RenderedVideo


class Ramp:
    """Pictures that brighten with time."""

    def render(self, t_ns):
        return np.full((48, 64, 3), (t_ns // 4_000_000) % 200 + 20, dtype=np.uint8)


def test_every_frame_is_one_access_unit_that_decodes():
    video = RenderedVideo(Ramp(), 64, 48)
    units = [video.access_unit(k) for k in range(65)]
    with av.open(io.BytesIO(b"".join(data for data, _ in units)), format="h264") as clip:
        decoded = [frame.to_ndarray(format="rgb24") for frame in clip.decode(video=0)]
    assert len(decoded) == 65
    assert np.abs(decoded[40].mean() - (40 * 1001 / 30 // 4 % 200 + 20)) < 6


def test_keyframes_come_every_second_with_their_parameter_sets():
    video = RenderedVideo(Ramp(), 64, 48)
    units = [video.access_unit(k) for k in range(61)]
    assert [k for k, (_, key) in enumerate(units) if key] == [0, 30, 60]
    for k in (0, 30, 60):
        assert b"\x00\x00\x00\x01\x67" in units[k][0]
        assert b"\x00\x00\x01\x68" in units[k][0]


def test_frames_out_of_order_are_refused():
    video = RenderedVideo(Ramp(), 64, 48)
    video.access_unit(5)
    with pytest.raises(SimulationError, match="in order"):
        video.access_unit(4)
