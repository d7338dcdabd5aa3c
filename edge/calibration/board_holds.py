"""The moments of a recording in which a board was held still before camera and LiDAR."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from edge.calibration.recording import CalibrationRecording
from edge.recording.calibration import CalibrationFile
from edge.replay.frames import every
from pipeline.calibration.board import Board, Sighting, find
from pipeline.calibration.board_extrinsics import Hold

LOOK_S = 0.2
STILL_PX = 0.002
"""Share of the width by which corners may move from look to look: 1.7 pixels of 848."""
LEAST_HOLD_S = 0.7
LONGEST_HOLD_S = 3.0
MARGIN_S = 0.1
"""Left out at both ends, where the board may still have been on its way."""


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    stamp_ns: int
    sighting: Sighting


def find_holds(
    recording: CalibrationRecording, board: Board, file: CalibrationFile, advance: Callable[[float], None]
) -> list[Hold]:
    """In order; camera stamps are put right by the file's lateness. FormatError for a recording without video."""
    late_ns = round(file.timing.camera_late_s * 1e9)
    found = []
    for looks in _stretches(recording, board, advance):
        first_ns, last_ns = looks[0].stamp_ns - late_ns, looks[-1].stamp_ns - late_ns
        margin_ns = round(MARGIN_S * 1e9)
        scans = list(recording.scans(first_ns + margin_ns, last_ns - margin_ns))
        points = np.vstack([scan.xyz_m for scan in scans]).astype(np.float64) if scans else np.empty((0, 3))
        found.append(Hold(_mean(looks), points))
    return found


def _stretches(
    recording: CalibrationRecording, board: Board, advance: Callable[[float], None]
) -> Iterator[list[_Look]]:
    first_ns, last_ns = recording.video_span_ns()
    stretch: list[_Look] = []
    for stamp_ns, image in recording.images(every(LOOK_S)):
        advance((stamp_ns - first_ns) / max(last_ns - first_ns, 1))
        name = f"{(stamp_ns - first_ns) * 1e-9:.1f} s"
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        seen = find(board, name, grey)
        goes_on = (
            seen is not None
            and bool(stretch)
            and _moved(stretch[0].sighting, seen) < STILL_PX * grey.shape[1]
            and stamp_ns - stretch[0].stamp_ns <= LONGEST_HOLD_S * 1e9
        )
        if not goes_on:
            if _long(stretch):
                yield stretch
            stretch = []
        if seen is not None:
            stretch.append(_Look(stamp_ns, seen))
    if _long(stretch):
        yield stretch


def _long(stretch: list[_Look]) -> bool:
    return bool(stretch) and stretch[-1].stamp_ns - stretch[0].stamp_ns >= LEAST_HOLD_S * 1e9


def _moved(one: Sighting, two: Sighting) -> float:
    """Greatest way of a corner (pixels); of a ChArUco board, of those in both."""
    a, b = one.by_corner, two.by_corner
    both = a.keys() & b.keys()
    return max(float(np.linalg.norm(a[key] - b[key])) for key in both) if both else np.inf


def _mean(looks: list[_Look]) -> Sighting:
    """Corners seen in all of them, averaged."""
    seen = [look.sighting.by_corner for look in looks]
    keys = sorted(set.intersection(*(set(corners) for corners in seen)), key=lambda key: (key[1], key[0]))
    board_m = np.array([[*key, 0.0] for key in keys])
    pixels = np.array([np.mean([corners[key] for corners in seen], axis=0) for key in keys])
    return Sighting(looks[0].sighting.name, board_m.reshape(-1, 3), pixels.reshape(-1, 2))
