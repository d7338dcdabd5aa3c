"""From a map to trees on the disk: measured, joined with detections, corrected, edited, handed out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from edge.config import Config
from edge.errors import EdgeError, FormatError
from edge.inventory.april_tags import read_april_tags
from edge.inventory.fine import fine_map
from edge.inventory.maps import Found, Session, find_map
from edge.inventory.pages import PAGE, write_pages
from edge.process.checkpoint import alone
from edge.process.product_facts import whole
from edge.process.watch import Watch
from pipeline.inventory.april_tags import Sighting
from pipeline.inventory.device import DeviceBias, corrected, fit_device_bias
from pipeline.inventory.field_list import read_field_list
from pipeline.inventory.inventory import Inventory, take_inventory
from pipeline.inventory.tagged import FieldMatch, Tagged, with_april_tags, with_field_list
from pipeline.inventory.trees import (
    EDIT_COLUMNS,
    EDITS_HEAD,
    ListedTree,
    TreeList,
    edited,
    listed,
    read_edits,
    with_detections,
)
from pipeline.products.inventory_laz import write_inventory_laz
from pipeline.products.inventory_tables import (
    write_rejected_csv,
    write_trees_csv,
    write_trees_gpkg,
    write_unmatched_csv,
)

EDITS, BIAS, FACTS, UNMATCHED = "tree_edits.csv", "device_bias.json", "inventory.json", "field_unmatched.csv"


@dataclass(frozen=True, slots=True)
class Asked:
    """marked: a field list of taped trees in the map's coordinates. bias: a file that an earlier run with one wrote.

    field_list: of trees with numbers, in any frame. april_tags: look for them in the session's video. fine: map the
    session once more, for diameters.
    """

    target: Path
    output: Path | None = None
    marked: Path | None = None
    bias: Path | None = None
    field_list: Path | None = None
    april_tags: bool = False
    laz: bool = True
    fine: bool = False


class InventoryFacts(msgspec.Struct):
    """`inventory.json`. files: name -> what it is."""

    map: str
    points: int
    crs: str
    trees: int
    rejected: int
    taped: int
    tagged: int
    with_species: int
    why: str = ""
    """Where there are no trees: what was there instead."""
    device_bias: DeviceBias | None = None
    field_list: FieldMatch | None = None
    notes: tuple[str, ...] = ()
    files: dict[str, str] = {}


def run_inventory(asked: Asked, config: Config, watch: Watch) -> tuple[Path, InventoryFacts]:
    """Where the files are, and what is in them. InventoryError, FormatError for what cannot be used."""
    found = find_map(asked.target, config, _remap(config, watch) if asked.fine else None)
    folder = asked.output or found.folder
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EdgeError(f"{folder}: cannot be made ({error.strerror}); give another place with --output") from error
    edits = read_edits(folder / EDITS) if (folder / EDITS).exists() else []
    listed_trees = read_field_list(asked.field_list) if asked.field_list is not None else None
    with alone(folder):
        seen, notes = _april_tags(asked, found, config, watch)
        watch.stage("stems", done=False)
        measured = take_inventory(found.source, config.inventory, watch.advance, folder)
        given = listed(measured, found.source)
        trees = with_detections(given.trees, found.detected or [], found.source)
        bias = _bias(asked, trees, found)
        if bias is not None:
            trees = corrected(trees, bias)
        trees, lost = with_april_tags(trees, seen)
        given, tagged = TreeList(trees, given.rejected, (*given.notes, *notes, *lost)), None
        if listed_trees is not None:
            tagged = with_field_list(given, listed_trees, found.source)
            given = replace(given, trees=tagged.trees)
        given = edited(given, edits)
        facts = _facts(found, measured, given, bias)
        _write(folder, given, facts, found)
        _write_field_list(folder, tagged, facts)
        if asked.laz:
            watch.stage("map", done=False)
            with whole(folder / "trees.laz") as path:
                write_inventory_laz(path, found.source, measured, watch.advance)
            facts.files["trees.laz"] = "points with tree_id and height_above_ground"
        with whole(folder / FACTS) as path:
            path.write_bytes(msgspec.json.format(msgspec.json.encode(facts), indent=2) + b"\n")
    return folder, facts


def _remap(config: Config, watch: Watch) -> Callable[[Session], Path]:
    return lambda session: fine_map(session.recording, session.places, config, watch)


def _april_tags(asked: Asked, found: Found, config: Config, watch: Watch) -> tuple[list[Sighting], tuple[str, ...]]:
    if not asked.april_tags:
        return [], ()
    if found.session is None or not found.session.recording:
        raise EdgeError(
            f"{asked.target}: AprilTags are read in the video of a session; process it, and name its folder"
        )
    watch.stage("april tags", done=False)
    return read_april_tags(found.session.recording, found.session.places, config, watch.advance)


def _bias(asked: Asked, trees: Sequence[ListedTree], found: Found) -> DeviceBias | None:
    if asked.marked is not None:
        return fit_device_bias(trees, read_field_list(asked.marked).on_map(found.source.crs))
    if asked.bias is None:
        return None
    try:
        return msgspec.json.decode(asked.bias.read_bytes(), type=DeviceBias)
    except (OSError, msgspec.MsgspecError) as error:
        raise FormatError(f"{asked.bias}: not what `inventory --marked` writes ({error})") from error


def _facts(found: Found, measured: Inventory, given: TreeList, bias: DeviceBias | None) -> InventoryFacts:
    crs = found.source.crs
    return InventoryFacts(
        map=found.source.name,
        points=found.source.count,
        crs=crs.name if crs is not None else "not told; metres are assumed",
        trees=len(given.trees),
        rejected=len(given.rejected),
        taped=sum(tree.stem is not None and tree.stem.taped for tree in given.trees),
        tagged=sum(bool(tree.tag) for tree in given.trees),
        with_species=sum(bool(np.isfinite(tree.probability)) for tree in given.trees),
        why=measured.why,
        device_bias=bias,
        notes=(*found.notes, *given.notes),
    )


def _write(folder: Path, given: TreeList, facts: InventoryFacts, found: Found) -> None:
    """All but the map."""
    files = facts.files
    with whole(folder / "trees.gpkg") as path:
        write_trees_gpkg(path, given, found.source.crs)
    with whole(folder / "trees.csv") as path:
        write_trees_csv(path, given)
    with whole(folder / "rejected.csv") as path:
        write_rejected_csv(path, given)
    files |= {"trees.gpkg": "layers trees and rejected", "trees.csv": "one row a tree", "rejected.csv": "and why"}
    files[PAGE] = write_pages(folder, given, [note for note in (facts.why, *facts.notes) if note])
    if facts.device_bias is not None:
        (folder / BIAS).write_bytes(msgspec.json.encode(facts.device_bias) + b"\n")
        files[BIAS] = "for other walks with the same device: --device-bias"
    if not (folder / EDITS).exists():
        (folder / EDITS).write_text(EDITS_HEAD + ",".join(EDIT_COLUMNS) + "\n", encoding="utf-8")
    files[EDITS] = "yours: confirm, add and delete trees; the next run begins with it"


def _write_field_list(folder: Path, tagged: Tagged | None, facts: InventoryFacts) -> None:
    """What could not be matched; a table of an earlier run does not stay behind."""
    (folder / UNMATCHED).unlink(missing_ok=True)
    if tagged is None:
        return
    facts.field_list = tagged.match
    if tagged.match.why:
        facts.notes += (f"the field list was not matched: {tagged.match.why}",)
    if tagged.unmatched:
        with whole(folder / UNMATCHED) as path:
            write_unmatched_csv(path, tagged.unmatched)
        facts.files[UNMATCHED] = f"{len(tagged.unmatched)} trees of the field list without a stem"
