"""A recorded clip in place of the rendered forest: its access units, over and over."""

from __future__ import annotations

from pathlib import Path

import av
from av.bitstream import BitStreamFilterContext

from drivers.errors import SimulationError


class ClipSource:
    """VideoSource over an H.264 file. The frames keep their bytes; their spacing becomes 1001/30000 s."""

    def __init__(self, path: Path) -> None:
        """Reads the whole file. SimulationError when it holds no H.264."""
        try:
            self._units = _read(path)
        except (av.FFmpegError, OSError) as error:
            raise SimulationError(f"{path} cannot be read as video: {error}") from error
        if not self._units:
            raise SimulationError(f"{path} has no H.264 video: name an MP4 as a GoPro writes it")

    def __len__(self) -> int:
        return len(self._units)

    def access_unit(self, index: int) -> tuple[bytes, bool]:
        """Access unit in Annex B, and whether it is a keyframe. After the last comes the first again."""
        return self._units[index % len(self._units)]


def _read(path: Path) -> list[tuple[bytes, bool]]:
    with av.open(str(path)) as container:
        stream = next((s for s in container.streams.video if s.codec_context.name == "h264"), None)
        if stream is None:
            return []
        to_annex_b = BitStreamFilterContext("h264_mp4toannexb", stream)
        packets = [out for packet in container.demux(stream) for out in to_annex_b.filter(packet)]
        return [(bytes(packet), packet.is_keyframe) for packet in packets if packet.size]
