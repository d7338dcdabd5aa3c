"""The LiDAR map around the camera, renewed as it moves on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from pipeline.grounding.ground import Ground
from pipeline.grounding.stems import Stem, find_stems

Array = npt.NDArray[np.float64]
RENEWED_M = 4.0


class PointSource(Protocol):
    """Where the points are from: the tiles of a session, or the last sweeps of a live one."""

    def around(self, place_m: Array, radius_m: float) -> Array:
        """(n, 3) points within a radius of a place (3,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """points_m: (n, 3). height_m: (n,) above the ground."""

    centre_m: Array
    points_m: Array
    height_m: Array
    ground: Ground
    stems: tuple[Stem, ...]

    @classmethod
    def of(cls, centre_m: Array, points_m: Array) -> Surroundings:
        """Of points (n, 3), n > 0."""
        ground = Ground.under(points_m)
        height = points_m[:, 2] - ground.at(points_m[:, :2])
        return cls(centre_m, points_m, height, ground, tuple(find_stems(points_m, height)))


class Neighbourhood:
    """Keeps the surroundings of the last place until the camera has moved on by `RENEWED_M`."""

    def __init__(self, source: PointSource, reach_m: float) -> None:
        self._source = source
        self._reach_m = reach_m
        self._held: Surroundings | None = None

    def at(self, place_m: Array) -> Surroundings | None:
        """None where there are no points."""
        held = self._held
        if held is None or np.linalg.norm(place_m - held.centre_m) > RENEWED_M:
            points = self._source.around(place_m, self._reach_m + RENEWED_M)
            held = self._held = Surroundings.of(place_m, points) if len(points) else None
        return held
