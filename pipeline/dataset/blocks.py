"""Blocks of images that go into one split as a whole: sites, squares of ground, stretches of time, observations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Literal

from pipeline.dataset.neighbours import same
from pipeline.dataset.record import ImageRecord

By = Literal["block", "site", "image"]
_DEGREE_M = 111_320.0


@dataclass(frozen=True, slots=True)
class BlockSize:
    """Side of a square of ground, and length of a stretch of time where there are no positions."""

    metres: float = 60.0
    seconds: float = 60.0


def find_blocks(records: Sequence[ImageRecord], by: By, size: BlockSize) -> list[list[int]]:
    """Places of the images of each block, in order. What belongs together for another reason joins two blocks."""
    keys: dict[str, list[int]] = {}
    for place, record in enumerate(records):
        keys.setdefault(_key(record, by, size), []).append(place)
    chains = (pair for members in keys.values() for pair in pairwise(members))
    return _joined(len(records), chain(chains, ((pair.i, pair.j) for pair in same(records))))


def _key(record: ImageRecord, by: By, size: BlockSize) -> str:
    if by == "image":
        return f"image {record.image}"
    if by == "site" and record.site:
        return f"site {record.site}"
    if record.placed and record.latitude_deg is not None and record.longitude_deg is not None:
        return _square(record.latitude_deg, record.longitude_deg, size.metres)
    if record.session and record.stamp_ns is not None:
        return f"time {record.session} {record.stamp_ns // round(size.seconds * 1e9)}"
    return f"image {record.image}"


def _square(latitude_deg: float, longitude_deg: float, side_m: float) -> str:
    """The same square whatever else is in the dataset: a degree of longitude is measured once for a tenth of a degree
    of latitude."""
    shrink = math.cos(math.radians(round(latitude_deg, 1)))
    east, north = longitude_deg * _DEGREE_M * shrink, latitude_deg * _DEGREE_M
    return f"square {round(latitude_deg, 1)} {math.floor(east / side_m)} {math.floor(north / side_m)}"


def _joined(count: int, pairs: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Connected components (union by the lower place)."""
    parents = list(range(count))

    def root(place: int) -> int:
        while parents[place] != place:
            parents[place] = parents[parents[place]]
            place = parents[place]
        return place

    for i, j in pairs:
        one, other = root(i), root(j)
        parents[max(one, other)] = min(one, other)
    blocks: dict[int, list[int]] = {}
    for place in range(count):
        blocks.setdefault(root(place), []).append(place)
    return list(blocks.values())
