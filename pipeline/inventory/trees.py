"""Trees as they are handed out: what was measured, what the detections say, and what an analyst decided."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.inventory.errors import InventoryError
from pipeline.inventory.inventory import Inventory
from pipeline.inventory.source import MapSource
from pipeline.inventory.stem import Stem
from pipeline.trees import Tree

Doubles = npt.NDArray[np.float64]
EDIT_COLUMNS = ("action", "x", "y", "dbh_cm", "height_m", "species", "tag", "note")
ACTIONS = ("add", "delete", "confirm")
EDITED_WITHIN_M = 1.0
"""An edit means the tree nearest to its place, this far at most."""
JOINED_WITHIN_M = 1.0
"""A detection belongs to the stem nearest to its place, this far and two of its sigmas at most."""
EDITS_HEAD = (
    "# What you decide about the trees of this map; it is never overwritten, and every run begins with it.\n"
    "# action: confirm, delete (x and y of the tree) or add (with dbh_cm); x, y: as in trees.csv. One tree a line.\n"
)


@dataclass(frozen=True, slots=True, eq=False)
class ListedTree:
    """position_m: (3,) base, in the coordinates of the map. stem: None for one that an analyst added.

    status: `unverified`, `confirmed` or `added`. species, probability, views, hits: of the detector, empty and NaN
    where none looked or no detection was near; or species of a field list. field_dbh_m: as taped, of such a list.
    height_m, crown_m: NaN where not seen.
    """

    tree_id: int
    position_m: Doubles
    dbh_m: float
    dbh_sigma_m: float
    height_m: float
    crown_m: float
    stem: Stem | None = None
    status: str = "unverified"
    species: str = ""
    probability: float = np.nan
    views: int = 0
    hits: int = 0
    tag: str = ""
    note: str = ""
    field_dbh_m: float = np.nan


@dataclass(frozen=True, slots=True)
class RejectedTree:
    """position_m: (3,) where it would stand; reason: in words."""

    position_m: tuple[float, float, float]
    dbh_m: float
    reason: str


@dataclass(frozen=True, slots=True)
class Edit:
    """A line of the analyst's file. dbh_m, height_m: NaN where not given."""

    action: str
    x_m: float
    y_m: float
    dbh_m: float
    height_m: float
    species: str
    tag: str
    note: str
    line: int


@dataclass(frozen=True, slots=True, eq=False)
class TreeList:
    """trees: numbered from 1. notes: edits that met nothing."""

    trees: list[ListedTree]
    rejected: list[RejectedTree]
    notes: tuple[str, ...] = ()


def listed(found: Inventory, source: MapSource) -> TreeList:
    """As the map says, before anybody looked."""
    bases = source.placed(np.array([stem.base_m for stem in found.stems]).reshape(-1, 3))
    trees = [
        ListedTree(k + 1, bases[k], s.dbh_m, s.dbh_sigma_m, float(found.height_m[k]), float(found.crown_m[k]), s)
        for k, s in enumerate(found.stems)
    ]
    places = source.placed(np.array([stem.base_m for stem in found.rejected]).reshape(-1, 3))
    rejected = [
        RejectedTree((float(at[0]), float(at[1]), float(at[2])), s.dbh_m, s.reason)
        for at, s in zip(places, found.rejected, strict=True)
    ]
    return TreeList(trees, rejected)


def with_detections(trees: Sequence[ListedTree], detected: Sequence[Tree], source: MapSource) -> list[ListedTree]:
    """Each detected individual, probable or not, says something of the stem nearest to it. detected: in the map's frame
    before it is placed."""
    out = list(trees)
    bases = np.array([tree.position_m[:2] for tree in trees]).reshape(-1, 2)
    for one in sorted(detected, key=lambda tree: tree.probability):  # the most probable last: it stays
        place = source.placed(one.position_m[None])[0, :2]
        away = np.hypot(*(bases - place).T)
        if len(away) and away.min() < JOINED_WITHIN_M + 2.0 * min(one.sigma_m, 1.0):
            k = int(away.argmin())
            out[k] = replace(
                out[k], species=one.class_name, probability=one.probability, views=one.views, hits=one.hits
            )
    return out


def read_edits(path: Path) -> list[Edit]:
    """InventoryError names file, line and what was expected."""
    edits = []
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = [(number, line) for number, line in enumerate(file, 1) if line.strip() and line[0] != "#"]
    except (OSError, UnicodeDecodeError) as error:
        raise InventoryError(f"{path}: cannot be read ({error})") from error
    if not lines:
        return []
    rows = csv.DictReader(line for _, line in lines)
    if not {"action", "x", "y"} <= set(rows.fieldnames or ()):
        raise InventoryError(f"{path}:{lines[0][0]}: expected the columns {', '.join(EDIT_COLUMNS)}")
    for (number, _), row in zip(lines[1:], rows, strict=False):
        edits.append(_edit(path, number, {k: (v or "").strip() for k, v in row.items() if k}))
    return edits


def _edit(path: Path, line: int, row: dict[str, str]) -> Edit:
    action = row["action"].lower()
    if action not in ACTIONS:
        raise InventoryError(f"{path}:{line}: action {row['action']!r}: expected one of {', '.join(ACTIONS)}")
    try:
        x, y = float(row["x"]), float(row["y"])
        dbh, height = (float(row[name]) if row.get(name) else np.nan for name in ("dbh_cm", "height_m"))
    except ValueError as error:
        raise InventoryError(f"{path}:{line}: x, y, dbh_cm and height_m are numbers ({error})") from error
    if action == "add" and not dbh > 0.0:
        raise InventoryError(f"{path}:{line}: an added tree needs its dbh_cm")
    words = (row.get("species", ""), row.get("tag", ""), row.get("note", ""))
    return Edit(action, x, y, dbh / 100.0, height, *words, line)


def edited(given: TreeList, edits: Sequence[Edit]) -> TreeList:
    """With what the analyst decided; numbers of trees stay, added ones come last."""
    trees: list[ListedTree | None] = list(given.trees)
    rejected, notes = list(given.rejected), list(given.notes)
    bases = np.array([tree.position_m for tree in given.trees]).reshape(-1, 3)
    for edit in edits:
        away = np.hypot(bases[:, 0] - edit.x_m, bases[:, 1] - edit.y_m)
        k = int(away.argmin()) if len(away) else -1
        near = trees[k] if k >= 0 and away[k] <= EDITED_WITHIN_M else None
        if edit.action == "add":
            ground = float(bases[k, 2]) if k >= 0 else 0.0
            trees.append(_added(edit, len(trees) + 1, ground))
        elif near is None:
            notes.append(f"line {edit.line}: no tree within {EDITED_WITHIN_M:g} m of {edit.x_m:.2f} {edit.y_m:.2f}")
        elif edit.action == "delete":
            at = near.position_m.tolist()
            rejected.append(RejectedTree((at[0], at[1], at[2]), near.dbh_m, f"deleted by the analyst: {edit.note}"))
            trees[k] = None
        else:
            trees[k] = _confirmed(near, edit)
    return TreeList([tree for tree in trees if tree is not None], rejected, tuple(notes))


def _added(edit: Edit, number: int, ground_m: float) -> ListedTree:
    return ListedTree(
        number, np.array([edit.x_m, edit.y_m, ground_m]), edit.dbh_m, np.nan, edit.height_m, np.nan,
        status="added", species=edit.species, tag=edit.tag, note=edit.note,
    )  # fmt: skip


def _confirmed(tree: ListedTree, edit: Edit) -> ListedTree:
    """What was measured by hand stands above what the map says."""
    taped = np.isfinite(edit.dbh_m)
    return replace(
        tree,
        status="confirmed",
        dbh_m=edit.dbh_m if taped else tree.dbh_m,
        dbh_sigma_m=np.nan if taped else tree.dbh_sigma_m,
        height_m=edit.height_m if np.isfinite(edit.height_m) else tree.height_m,
        species=edit.species or tree.species,
        tag=edit.tag or tree.tag,
        note=edit.note,
    )
