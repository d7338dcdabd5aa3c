"""Where the way may have come by before: pairs of submaps that the trajectory brings near each other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimates import Array
from pipeline.products.covariance import horizontal_sigma_m
from pipeline.refinement.config import ClosureConfig
from pipeline.refinement.keyframes import Keyframes, Poses
from pipeline.refinement.recognition import Recognised
from pipeline.refinement.submaps import Submap

_SURE = 2.0
"""Sigmas of the distance that are added to the reach."""
_RINGS_M = (2.0, 4.0)
_DIRECTIONS = 6


@dataclass(frozen=True, slots=True)
class Candidate:
    """Submaps a < b by number, those of all sessions counted on; sigma_m of where they lie to each other. guess: (4, 4)
    of b from a, or None: as the trajectory has it. recognised: by which stems."""

    a: int
    b: int
    apart_m: float
    sigma_m: float
    guess: Array | None = None
    recognised: Recognised | None = None

    @property
    def origin(self) -> str:
        """Where it came from, in a word."""
        if self.recognised is not None:
            return "stems"
        return "way" if self.guess is None else "analyst"


def candidates(
    keys: Sequence[int], frames: Keyframes, poses: Poses, covariance: Array, config: ClosureConfig
) -> Iterator[Candidate]:
    """The nearest ones of each submap: some of its own session, one of each other.

    keys: the keyframe that each submap hangs on. covariance: (m, 6, 6).
    """
    places, way_m, session = poses.positions_m[keys], frames.travelled_m[keys], frames.session[keys]
    sigma = horizontal_sigma_m(covariance)[keys]
    for b in range(len(keys)):
        apart = np.linalg.norm(places[:b, :2] - places[b, :2], axis=1)
        unsure = np.hypot(sigma[:b], sigma[b])
        near = apart < np.minimum(config.reach_m + _SURE * unsure, config.most_m)
        other = session[:b] != session[b]
        near &= other | (way_m[b] - way_m[:b] > config.apart_m)
        for number in range(session[b] + 1):
            found = np.flatnonzero(near & (session[:b] == number))
            most = config.each if number == session[b] else 1
            for a in found[np.argsort(apart[found], kind="stable")][:most].tolist():
                yield Candidate(a, b, float(apart[a]), float(unsure[a]))


def keys_of(submaps: Sequence[Sequence[Submap]], frames: Keyframes) -> list[int]:
    """The keyframe that each submap of each session hangs on: the one nearest to its middle."""
    found = []
    for number, own in enumerate(submaps):
        mine = np.flatnonzero(frames.session == number)
        found += [int(mine[np.argmin(np.abs(frames.index[mine] - submap.middle))]) for submap in own]
    return found


def guesses(expected: Array, sigma_m: float) -> list[Array]:
    """Poses (4, 4) around the expected one, in rings as wide as the trajectory is unsure, and one wider: look-alike
    places are told by fitting there too."""
    found = [expected]
    rings = [_RINGS_M[0], *(r for r in _RINGS_M[1:] if r <= 2.0 * sigma_m + _RINGS_M[0])]
    for radius in rings:
        for k in range(_DIRECTIONS):
            angle = 2.0 * math.pi * k / _DIRECTIONS
            shifted = expected.copy()
            shifted[:2, 3] += radius * np.array([math.cos(angle), math.sin(angle)])
            found.append(shifted)
    return found
