"""`onboard_video.json` in the session's folder: which of the camera's own files belong to it, and their time.

The files stay where they are: a walk is 30 GB. Session time of the frame that is t seconds after the first frame of the
first chapter: begin_ns + (1 + drift) * t. A chapter's own first frame is start_s after that.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from edge.errors import FormatError
from edge.recording.disk import Disk

NAME = "onboard_video.json"


class ChapterNote(msgspec.Struct, frozen=True):
    """file: where it was found; name and size tell it again elsewhere."""

    file: str
    size_bytes: int
    start_s: float
    duration_s: float
    width_px: int
    height_px: int


class VideoNote(msgspec.Struct, frozen=True):
    """One recording of the camera. sigma_s: of begin_ns; drift: relative; rotation: (3, 3), `base_link` to its gyro."""

    chapters: tuple[ChapterNote, ...]
    begin_ns: int
    drift: float
    sigma_s: float
    correlation: float
    rival: float
    rotation: tuple[tuple[float, float, float], ...]
    created: str = ""
    firmware: str = ""
    imported: str = ""

    def session_ns(self, chapter: int, at_s: float) -> int:
        """Of the frame that is at_s after the first of a chapter."""
        return self.begin_ns + round((1.0 + self.drift) * (self.chapters[chapter].start_s + at_s) * 1e9)


class OnboardVideo(msgspec.Struct, frozen=True):
    """The whole file."""

    version: int = 1
    videos: tuple[VideoNote, ...] = ()


def read_onboard(session: Path) -> OnboardVideo:
    """Empty where nothing was imported. FormatError for a broken file."""
    path = session / NAME
    if not path.exists():
        return OnboardVideo()
    try:
        return msgspec.json.decode(path.read_bytes(), type=OnboardVideo)
    except (OSError, msgspec.MsgspecError) as error:
        raise FormatError(f"{path}: cannot be read ({error}); delete it and import the videos again") from error


def add_video(session: Path, video: VideoNote) -> Path:
    """Write it, in place of what there was about the same files. Atomic; FormatError when the disk refuses."""
    names = {Path(chapter.file).name for chapter in video.chapters}
    others = [
        old for old in read_onboard(session).videos if not names & {Path(chapter.file).name for chapter in old.chapters}
    ]
    made = OnboardVideo(videos=tuple(sorted([*others, video], key=lambda one: one.begin_ns)))
    path = session / NAME
    try:
        Disk().replace(path, msgspec.json.format(msgspec.json.encode(made), indent=2) + b"\n")
    except OSError as error:
        raise FormatError(f"{path}: cannot be written ({error.strerror}); is the folder yours?") from error
    return path
