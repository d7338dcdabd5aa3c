"""How trees stand in an image: how much of each is seen, and between which rows its lower end can show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.grounding.depth import DepthImage
from pipeline.grounding.sighting import Sighting

Array = npt.NDArray[np.float64]
FOOT_M = np.array([0.0, 0.25])
COLUMN_M = np.arange(0.5, 4.6, 0.5)
"""Heights above the ground at which a tree is looked for in an image."""
LEAST_SHOWN = 0.4
"""Share of these that must be in the image and unhidden, or the view says nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Of trees (h,): share of the heights in the image and unhidden; column_px in the middle of these; row_px of the
    lowest one, and foot_px of the lowest one in the image, hidden or not. NaN where there is none."""

    share: Array
    column_px: Array
    row_px: Array
    foot_px: Array

    @classmethod
    def of(cls, places_m: Array, depth: DepthImage) -> Columns:
        """places_m: (h, 2)."""
        heights = np.concatenate([FOOT_M, COLUMN_M])
        points = np.repeat(np.column_stack([places_m, depth.ground.at(places_m)]), len(heights), axis=0)
        points[:, 2] += np.tile(heights, len(places_m))
        seen = depth.look(points)
        shape = (len(places_m), len(heights))
        shown, inside = depth.unhidden(seen).reshape(shape), (seen[:, 2] > 0.0).reshape(shape)
        u, v = (seen[:, axis].astype(np.float64).reshape(shape) for axis in (0, 1))
        lowest, foot = (_first(v, which) for which in (shown, inside))
        middle = _first(np.sort(np.where(shown, u, np.inf), axis=1), _half(shown.sum(axis=1), shape))
        return cls(shown[:, len(FOOT_M) :].mean(axis=1), middle, lowest, foot)

    @property
    def shown(self) -> npt.NDArray[np.bool_]:
        """(h,) enough of it to say that it has no box."""
        return np.asarray(self.share >= LEAST_SHOWN)

    def under(self, sightings: Sequence[Sighting]) -> npt.NDArray[np.bool_]:
        """(h,) a box of some tree covers it."""
        covered = np.zeros(len(self.share), np.bool_)
        for one in sightings:
            covered |= (self.column_px >= one.box_px[0]) & (self.column_px <= one.box_px[2])
        return covered

    def amiss_px(self, bottom_px: float) -> Array:
        """(h,) by how much a box ends above what stands there unhidden, or below its foot."""
        above = np.nan_to_num(self.row_px - bottom_px, nan=0.0)
        below = np.nan_to_num(bottom_px - self.foot_px, nan=0.0)
        return np.asarray(np.maximum(np.maximum(above, below), 0.0))


def _first(values: Array, which: npt.NDArray[np.bool_]) -> Array:
    """(h,) of (h, k) where `which` is first true; NaN where it never is."""
    found = values[np.arange(len(values)), which.argmax(axis=1)]
    return np.asarray(np.where(which.any(axis=1), found, np.nan))


def _half(count: npt.NDArray[np.int64], shape: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """True from the middle of the first `count` on."""
    return np.asarray((np.arange(shape[1]) >= count[:, None] // 2) & (count > 0)[:, None])
