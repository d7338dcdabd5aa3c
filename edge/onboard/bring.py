"""The camera's own files onto a session's time, by how both turned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from edge.calibration.file import today
from edge.calibration.recording import CalibrationRecording
from edge.onboard.record import ChapterNote, VideoNote
from edge.onboard.telemetry import Chapter, read_chapter, turning
from pipeline.calibration.offset import TimeOffset, find_offset

LEAST_OVERLAP_S = 10.0
PHASE_S = 0.005
"""The camera's gyroscope is filtered, and up to 10 ms late against its own frames, by mode; half of that is added."""


class BringReport(msgspec.Struct, frozen=True):
    """begin_s: of the video, after the session's first inertial sample. refusal: why it cannot be told, if so."""

    files: tuple[str, ...]
    begin_s: float
    duration_s: float
    shared_s: float
    sigma_s: float
    drift_ppm: float
    correlation: float
    rival: float
    stretches: int
    refusal: str


def bring(
    paths: Sequence[Path], recording: CalibrationRecording, advance: Callable[[float], None]
) -> tuple[VideoNote, BringReport]:
    """paths: chapters of one recording in order. FormatError, CalibrationError when there is nothing to compare."""
    chapters = []
    for number, path in enumerate(paths):
        chapters.append(read_chapter(path))
        advance(0.7 * (number + 1) / len(paths))
    gyro = recording.gyro()
    session_begin_ns, session_end_ns = int(gyro.begin_ns[0]), int(gyro.end_ns[-1])
    own, starts = turning(chapters, session_begin_ns)
    length_s, session_s = (int(own.end_ns[-1]) - session_begin_ns) * 1e-9, (session_end_ns - session_begin_ns) * 1e-9
    least_s = min(LEAST_OVERLAP_S, 0.5 * length_s)
    found = find_offset(own, gyro, -length_s + least_s, session_s - least_s, least_s)
    note = _note(chapters, starts, found, session_begin_ns)
    begin_s = (note.begin_ns - session_begin_ns) * 1e-9
    report = BringReport(
        files=tuple(path.name for path in paths),
        begin_s=begin_s,
        duration_s=length_s,
        shared_s=max(min(begin_s + length_s, session_s) - max(begin_s, 0.0), 0.0),
        sigma_s=note.sigma_s,
        drift_ppm=1e6 * note.drift,
        correlation=found.correlation,
        rival=found.rival,
        stretches=found.stretches,
        refusal=found.refusal,
    )
    return note, report


def _note(chapters: Sequence[Chapter], starts: Sequence[float], found: TimeOffset, session_begin_ns: int) -> VideoNote:
    # later_s holds at at_ns; back to the first frame along the drift.
    first_s = found.later_s - found.drift * (found.at_ns - session_begin_ns) * 1e-9
    sigma_s = float(np.hypot(found.sigma_s, PHASE_S)) if np.isfinite(found.sigma_s) else -1.0
    return VideoNote(
        chapters=tuple(
            ChapterNote(
                str(chapter.path.absolute()),
                chapter.path.stat().st_size,
                round(start, 6),
                round(chapter.duration_s, 6),
                chapter.width_px,
                chapter.height_px,
            )
            for start, chapter in zip(starts, chapters, strict=True)
        ),
        begin_ns=session_begin_ns + round(first_s * 1e9),
        drift=found.drift,
        sigma_s=sigma_s,
        correlation=found.correlation,
        rival=found.rival,
        rotation=_rows(found),
        created=chapters[0].created,
        firmware=chapters[0].firmware,
        imported=today(),
    )


def _rows(found: TimeOffset) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(a), float(b), float(c)) for a, b, c in found.rotation)
