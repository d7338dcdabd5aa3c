"""Which images of a walk are worth a label: of each stretch of way the sharpest, and none that looks like another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.dataset.hashes import NEAR_BITS, HashIndex, perceptual_hash
from pipeline.dataset.sharpness import sharpness

Image = npt.NDArray[np.uint8]
_APART = 0.5
"""Of a stretch: the sharpest of two neighbours are not closer than this."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """One image (h, w, 3) BGR. along: how far on it is, in the unit of the stretches (metres, or seconds)."""

    stamp_ns: int
    along: float
    image: Image


@dataclass(frozen=True, slots=True, eq=False)
class Chosen:
    """A candidate that was taken."""

    candidate: Candidate
    sharpness: float
    phash: str


@dataclass(slots=True)
class Tally:
    """What was looked at, and what was left out although it was the best of its stretch."""

    seen: int = 0
    alike: int = 0
    blurred: int = 0


def choose(
    candidates: Iterable[Candidate],
    stretch: float,
    tally: Tally,
    *,
    least_sharpness: float = 0.0,
    near_bits: int = NEAR_BITS,
    known: Iterable[str] = (),
) -> Iterator[Chosen]:
    """The sharpest of each stretch, in order. Holds one image at a time.

    known: hashes of images that are there already. Left out are images of which the hash is near to one of these, or
    to one chosen before, and those that are not sharp enough.
    """
    hashes = HashIndex(known, near_bits)
    for best in _sharpest(candidates, stretch, tally):
        if best.sharpness < least_sharpness:
            tally.blurred += 1
        elif hashes.near(best.phash):
            tally.alike += 1
        else:
            hashes.add(best.phash)
            yield best


def _sharpest(candidates: Iterable[Candidate], stretch: float, tally: Tally) -> Iterator[Chosen]:
    best: tuple[float, Candidate] | None = None
    last = -np.inf
    for candidate in candidates:
        tally.seen += 1
        if best is not None and candidate.along // stretch != best[1].along // stretch:
            last = best[1].along
            yield _chosen(*best)
            best = None
        if candidate.along - last < _APART * stretch:
            continue
        found = sharpness(_grey(candidate.image))
        if best is None or found > best[0]:
            best = found, candidate
    if best is not None:
        yield _chosen(*best)


def _chosen(found: float, candidate: Candidate) -> Chosen:
    return Chosen(candidate, found, perceptual_hash(_grey(candidate.image)))


def _grey(image: Image) -> Image:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
