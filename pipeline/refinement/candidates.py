"""Where the way may have come by before: pairs of submaps that the trajectory brings near each other."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.estimates import Array
from pipeline.products.covariance import horizontal_sigma_m
from pipeline.refinement.config import ClosureConfig
from pipeline.refinement.keyframes import Keyframes, Poses
from pipeline.refinement.submaps import Submap

_SURE = 2.0
"""Sigmas of the distance that are added to the reach."""
_RINGS_M = (2.0, 4.0)
_DIRECTIONS = 6


@dataclass(frozen=True, slots=True)
class Candidate:
    """Submaps a < b by number; sigma_m of where they lie to each other. guess: (4, 4) of b from a, or None: as the
    trajectory has it."""

    a: int
    b: int
    apart_m: float
    sigma_m: float
    guess: Array | None = None


def candidates(
    submaps: list[Submap], frames: Keyframes, poses: Poses, covariance: Array, config: ClosureConfig
) -> Iterator[Candidate]:
    """The nearest ones of each submap. covariance: (m, 6, 6) of the keyframes."""
    keys = keys_of(submaps, frames)
    places, way_m = poses.positions_m[keys], frames.travelled_m[keys]
    sigma = horizontal_sigma_m(covariance)[keys]
    for b in range(len(submaps)):
        apart = np.linalg.norm(places[:b, :2] - places[b, :2], axis=1)
        unsure = np.hypot(sigma[:b], sigma[b])
        near = apart < np.minimum(config.reach_m + _SURE * unsure, config.most_m)
        near &= way_m[b] - way_m[:b] > config.apart_m
        found = np.flatnonzero(near)
        for a in found[np.argsort(apart[found], kind="stable")][: config.each].tolist():
            yield Candidate(a, b, float(apart[a]), float(unsure[a]))


def keys_of(submaps: list[Submap], frames: Keyframes) -> list[int]:
    """The keyframe that each submap hangs on: the one nearest to its middle."""
    middles = np.array([submap.middle for submap in submaps])
    after = np.clip(np.searchsorted(frames.index, middles), 1, len(frames) - 1)
    earlier = middles - frames.index[after - 1] < frames.index[after] - middles
    return [int(k) for k in np.where(earlier, after - 1, after)]


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
