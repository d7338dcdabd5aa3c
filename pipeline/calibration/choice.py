"""Which pictures of a video to calibrate from: the board at many places and angles, and held still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.calibration.board import Sighting

NEW_PLACE = 0.06
"""Of the picture's width: nearer than this to a chosen one, the board is where it was."""
SHAKEN = 0.02
"""It moved by more of the width since the picture before: blurred, and bent by a rolling shutter."""


@dataclass(slots=True)
class _Chosen:
    sighting: Sighting
    moved: float


class Choice:
    """Takes sightings in order; of those alike it keeps the one in which the board moved least."""

    def __init__(self, width_px: int, most: int = 60) -> None:
        self._width_px = width_px
        self._most = most
        self._chosen: list[_Chosen] = []
        self._before: Sighting | None = None
        self.shaken = 0
        self.alike = 0

    def add(self, sighting: Sighting | None) -> None:
        """None: the board was not there."""
        before, self._before = self._before, sighting
        if sighting is None:
            return
        moved = self._apart(sighting, before) if before is not None else SHAKEN
        if moved > SHAKEN:
            self.shaken += 1
            return
        near = [one for one in self._chosen if self._apart(one.sighting, sighting) < NEW_PLACE]
        if not near:
            self._chosen.append(_Chosen(sighting, moved))
            return
        self.alike += 1
        if len(near) == 1 and moved < near[0].moved:
            near[0].sighting, near[0].moved = sighting, moved

    def sightings(self) -> list[Sighting]:
        """The chosen ones; the stillest, where there are more than enough."""
        stillest = sorted(self._chosen, key=lambda one: one.moved)[: self._most]
        return [one.sighting for one in self._chosen if any(one is kept for kept in stillest)]

    def _apart(self, one: Sighting, two: Sighting) -> float:
        """Mean way of the corners that both show; another part of the board is another place."""
        a, b = one.by_corner, two.by_corner
        both = a.keys() & b.keys()
        if len(both) < 4:
            return 1.0
        return float(np.mean([np.linalg.norm(a[k] - b[k]) for k in both])) / self._width_px
