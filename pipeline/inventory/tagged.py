"""Trees with the numbers that a field crew gave them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np
import numpy.typing as npt

from pipeline.inventory.april_tags import Sighting, on_stems
from pipeline.inventory.constellation import Constellation, match
from pipeline.inventory.field_list import FieldList, FieldTree
from pipeline.inventory.source import MapSource
from pipeline.inventory.trees import ListedTree, RejectedTree, TreeList

Doubles = npt.NDArray[np.float64]
AROUND_M = 20.0
"""A list in metres whose trees lie within the map, or this far beside it, is taken to be in the map's coordinates."""
REJECTED_WITHIN_M = 0.7


class FieldMatch(msgspec.Struct, frozen=True):
    """listed trees, those of them that were matched, and those of these that a tag read in the images told.

    turn_deg, rms_m: of the list onto the map. margin_nats: log-likelihood ratio to the best other answer. why: it was
    not matched; empty where it was.
    """

    listed: int
    matched: int
    read: int
    turn_deg: float
    rms_m: float
    margin_nats: float
    why: str = ""


@dataclass(frozen=True, slots=True)
class Unmatched:
    """A listed tree without a stem. position_m: on the map; NaN where the list is not matched."""

    tree: FieldTree
    position_m: tuple[float, float]
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Tagged:
    """What a field list says of the trees of a map."""

    trees: list[ListedTree]
    match: FieldMatch
    unmatched: list[Unmatched]


def with_field_list(given: TreeList, field: FieldList, source: MapSource) -> Tagged:
    """Tags, diameters and species of the list on the trees that they belong to; on those that were read in images also
    where the rest of the list cannot be matched."""
    trees = list(given.trees)
    at, same_frame = _near_origin(field, source)
    bases = np.array([tree.position_m[:2] for tree in trees]).reshape(-1, 2) - source.origin_m[:2]
    known = _read(trees, field.trees)
    measured = Constellation(bases, np.array([tree.dbh_m for tree in trees]))
    found = match(Constellation(at, field.dbh_m), measured, known, same_frame=same_frame)
    pairs = found.pairs.tolist() if not found.why else known
    for row, k in pairs:
        trees[k] = _told(trees[k], field.trees[row])
    left = [row for row in range(len(field.trees)) if row not in {pair[0] for pair in pairs}]
    places = found.placed(at) + source.origin_m[:2] if not found.why else np.full((len(at), 2), np.nan)
    unmatched = [
        Unmatched(
            field.trees[k], (float(places[k, 0]), float(places[k, 1])), found.why or _why(places[k], given.rejected)
        )
        for k in left
    ]
    told = FieldMatch(
        len(field.trees), len(pairs), len(known), float(np.degrees(found.turn_rad)) if not found.why else float("nan"),
        found.rms_m, found.margin_nats, found.why,
    )  # fmt: skip
    return Tagged(trees, told, unmatched)


def with_april_tags(trees: Sequence[ListedTree], seen: Sequence[Sighting]) -> tuple[list[ListedTree], tuple[str, ...]]:
    """The numbers on the stems that they were seen on, and in words which hang on none. seen: in the map's frame before
    it is placed."""
    rows = [k for k, tree in enumerate(trees) if tree.stem is not None]
    hung, notes = on_stems(seen, [stem for tree in trees if (stem := tree.stem) is not None])
    out = list(trees)
    for row, number in hung.items():
        out[rows[row]] = replace(out[rows[row]], tag=str(number))
    return out, notes


def same_tag(one: str, other: str) -> bool:
    """`007` is `7`."""
    a, b = one.strip(), other.strip()
    return a == b or (a.isdigit() and b.isdigit() and int(a) == int(b))


def _near_origin(field: FieldList, source: MapSource) -> tuple[Doubles, bool]:
    """Places of the list from the map's origin, or as they are; and whether they are in the map's coordinates."""
    at = field.places_m(source.crs)
    if field.frame == "plot" or (field.frame == "degrees" and source.crs is None):
        return at - at.mean(axis=0), False
    here = at - source.origin_m[:2]
    low, high = source.bounds_m[0] - AROUND_M, source.bounds_m[1] + AROUND_M
    inside = bool(((here >= low) & (here <= high)).all())
    return (here, True) if inside or field.frame == "degrees" else (at - at.mean(axis=0), False)


def _read(trees: Sequence[ListedTree], listed: Sequence[FieldTree]) -> list[tuple[int, int]]:
    """Rows of list and map that have a tag in common."""
    return [
        (row, k)
        for row, one in enumerate(listed)
        for k, tree in enumerate(trees)
        if one.tag and tree.tag and same_tag(one.tag, tree.tag)
    ]


def _told(tree: ListedTree, said: FieldTree) -> ListedTree:
    """A person who stood before the tree knows its species better than a detector."""
    known = bool(said.species) and said.species != tree.species
    return replace(
        tree,
        tag=said.tag or tree.tag,
        field_dbh_m=said.dbh_m,
        species=said.species or tree.species,
        probability=float("nan") if known else tree.probability,
    )


def _why(place_m: Doubles, rejected: Sequence[RejectedTree]) -> str:
    away = [float(np.hypot(one.position_m[0] - place_m[0], one.position_m[1] - place_m[1])) for one in rejected]
    if away and min(away) < REJECTED_WITHIN_M:
        return f"rejected there: {rejected[int(np.argmin(away))].reason}"
    return "no stem was found there"
