"""Images out of a recording's video."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from edge.config import Topics
from edge.errors import FormatError
from edge.replay.store import MessageStore
from edge.replay.video import Choose, Frame, LazyDecoder, VideoTally
from edge.ros import schemas
from edge.ros.decode import decode_video
from edge.validation.index import Topic

H264 = "h264"


class VideoFrames:
    """The frames of one topic. `read` may be called again and again."""

    def __init__(self, store: MessageStore, topic: str) -> None:
        self.topic = topic
        self.tally = VideoTally()
        """Of the last reading; counts while it goes."""
        self.unreadable = 0
        """Messages that are none, likewise."""
        self._store = store

    @property
    def span_ns(self) -> tuple[int, int]:
        """When the first and the last arrived."""
        times = self._store.times_ns(self.topic)
        return (int(times.min()), int(times.max())) if len(times) else (0, 0)

    @property
    def told(self) -> tuple[str, ...]:
        """What could not be used, in words."""
        said = (f"{self.unreadable} messages of {self.topic} cannot be read",) if self.unreadable else ()
        return (*said, *self.tally.told)

    def read(self, choose: Choose) -> Iterator[Frame]:
        """The chosen ones that can be decoded, in order. FormatError for a video that is not H.264."""
        decoder = LazyDecoder()
        self.tally, self.unreadable = decoder.tally, 0
        for raw in self._store.messages({self.topic}):
            try:
                video = decode_video(raw.data)
            except FormatError:
                self.unreadable += 1
                continue
            if video.format != H264:
                raise FormatError(f"{self.topic}: its video is {video.format!r}, only {H264!r} can be decoded")
            yield from decoder.add(video.stamp_ns, video.data, choose)
        yield from decoder.flush()


def every(period_s: float) -> Choose:
    """The first frame, and then the first at or after each period. 0: all of them."""
    period_ns = round(period_s * 1e9)
    due_ns: int | None = None

    def choose(stamp_ns: int) -> bool:
        nonlocal due_ns
        if due_ns is not None and period_ns and stamp_ns < due_ns:
            return False
        # On the grid of the first, unless there was a pause.
        due_ns = stamp_ns + period_ns if due_ns is None or stamp_ns - due_ns >= period_ns else due_ns + period_ns
        return True

    return choose


def video_topic(topics: Mapping[str, Topic], names: Topics) -> str:
    """By name where the configuration's is there, else by type; empty where there is none."""
    found = [name for name, topic in topics.items() if topic.type_name == schemas.COMPRESSED_VIDEO]
    return names.video if names.video in found else min(found, default="")
