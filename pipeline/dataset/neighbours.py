"""Images that show the same: of one observation, alike, or taken near each other. Across splits they are leaks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pipeline.dataset.hashes import near_pairs
from pipeline.dataset.record import SPLITS, ImageRecord
from pipeline.gnss.geodesy import ecef

Kind = Literal["group", "alike", "place", "time"]
WORDS: dict[Kind, str] = {
    "group": "of one observation",
    "alike": "nearly the same picture",
    "place": "nearer than the gap",
    "time": "closer in time than the gap",
}


@dataclass(frozen=True, slots=True)
class Gap:
    """Images of different splits have to be so far apart; in time where there are no positions."""

    metres: float = 20.0
    seconds: float = 20.0


@dataclass(frozen=True, slots=True)
class Pair:
    """Places i < j of two images of a dataset, and what makes them neighbours."""

    i: int
    j: int
    kind: Kind


def same(records: Sequence[ImageRecord]) -> Iterator[Pair]:
    """What may never be parted: observations, and pictures that are alike. Of a group, a chain through all of it."""
    groups: dict[str, list[int]] = {}
    for place, record in enumerate(records):
        if record.group:
            groups.setdefault(record.group, []).append(place)
    for members in groups.values():
        yield from (Pair(i, j, "group") for i, j in pairwise(members))
    yield from (Pair(i, j, "alike") for i, j in near_pairs([record.phash for record in records]))


def near(records: Sequence[ImageRecord], gap: Gap) -> Iterator[Pair]:
    """Pairs within the gap: by place where both have one, else by time within a session."""
    placed = [place for place, record in enumerate(records) if record.placed]
    if len(placed) > 1:
        tree = cKDTree(_earth_m([records[place] for place in placed]))
        found = tree.query_pairs(gap.metres, output_type="ndarray")
        yield from (Pair(placed[i], placed[j], "place") for i, j in np.sort(found, axis=1).tolist())
    yield from _in_time(records, gap.seconds)


def leaks(records: Sequence[ImageRecord], gap: Gap) -> list[Pair]:
    """Neighbours in different splits. Groups are looked at as a whole, so one that is torn is counted once a tear."""
    pairs = [*same(records), *near(records, gap)]
    return [pair for pair in pairs if _parted(records[pair.i], records[pair.j])]


def _parted(one: ImageRecord, other: ImageRecord) -> bool:
    return one.split in SPLITS and other.split in SPLITS and one.split != other.split


def _earth_m(records: Sequence[ImageRecord]) -> npt.NDArray[np.float64]:
    """(n, 3) in Earth-centred axes, on the ellipsoid: heights of different sources do not agree."""
    return np.array([ecef(record.latitude_deg or 0.0, record.longitude_deg or 0.0, 0.0) for record in records])


def _in_time(records: Sequence[ImageRecord], seconds: float) -> Iterator[Pair]:
    sessions: dict[str, list[int]] = {}
    for place, record in enumerate(records):
        if record.session and record.stamp_ns is not None:
            sessions.setdefault(record.session, []).append(place)
    for members in sessions.values():
        ordered = sorted(members, key=lambda place: records[place].stamp_ns or 0)
        stamps = np.array([records[place].stamp_ns for place in ordered], np.int64)
        ends = np.searchsorted(stamps, stamps + round(seconds * 1e9), side="right")
        for first, end in enumerate(ends.tolist()):
            for second in range(first + 1, end):
                i, j = sorted((ordered[first], ordered[second]))
                if not (records[i].placed and records[j].placed):
                    yield Pair(i, j, "time")
