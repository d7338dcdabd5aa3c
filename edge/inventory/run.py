"""From a map to trees on the disk: measured, joined with detections, corrected, edited, handed out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from edge.config import Config
from edge.errors import EdgeError, FormatError
from edge.inventory.maps import Found, find_map
from edge.process.checkpoint import alone
from edge.process.product_facts import whole
from edge.process.watch import Watch
from pipeline.inventory.device import DeviceBias, corrected, fit_device_bias, read_field_list
from pipeline.inventory.inventory import Inventory, take_inventory
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
from pipeline.products.inventory_page import write_plot_page
from pipeline.products.inventory_tables import write_rejected_csv, write_trees_csv, write_trees_gpkg

EDITS, BIAS, FACTS = "tree_edits.csv", "device_bias.json", "inventory.json"
PLOT_M = 50.0
MOST_ON_A_PAGE = 400
"""Trees; beyond, each square of `PLOT_M` with trees has a page of its own."""


@dataclass(frozen=True, slots=True)
class Asked:
    """marked: a field list of taped trees. bias: a file that an earlier run with one wrote."""

    target: Path
    output: Path | None = None
    marked: Path | None = None
    bias: Path | None = None
    laz: bool = True


class InventoryFacts(msgspec.Struct):
    """`inventory.json`. files: name -> what it is."""

    map: str
    points: int
    crs: str
    trees: int
    rejected: int
    taped: int
    with_species: int
    why: str = ""
    """Where there are no trees: what was there instead."""
    device_bias: DeviceBias | None = None
    notes: tuple[str, ...] = ()
    files: dict[str, str] = {}


def run_inventory(asked: Asked, config: Config, watch: Watch) -> tuple[Path, InventoryFacts]:
    """Where the files are, and what is in them. InventoryError, FormatError for what cannot be used."""
    found = find_map(asked.target, config)
    folder = asked.output or found.folder
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EdgeError(f"{folder}: cannot be made ({error.strerror}); give another place with --output") from error
    edits = read_edits(folder / EDITS) if (folder / EDITS).exists() else []
    with alone(folder):
        watch.stage("stems", done=False)
        measured = take_inventory(found.source, config.inventory, watch.advance, folder)
        given = listed(measured, found.source)
        trees = with_detections(given.trees, found.detected or [], found.source)
        bias = _bias(asked, trees)
        if bias is not None:
            trees = corrected(trees, bias)
        given = edited(TreeList(trees, given.rejected), edits)
        facts = _facts(found, measured, given, bias)
        _write(folder, given, facts, found)
        if asked.laz:
            watch.stage("map", done=False)
            with whole(folder / "trees.laz") as path:
                write_inventory_laz(path, found.source, measured, watch.advance)
            facts.files["trees.laz"] = "points with tree_id and height_above_ground"
        with whole(folder / FACTS) as path:
            path.write_bytes(msgspec.json.format(msgspec.json.encode(facts), indent=2) + b"\n")
    return folder, facts


def _bias(asked: Asked, trees: Sequence[ListedTree]) -> DeviceBias | None:
    if asked.marked is not None:
        return fit_device_bias(trees, read_field_list(asked.marked))
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
    for name, title, list_ in _pages(given):
        notes = [note for note in (facts.why, *facts.notes) if note]
        with whole(folder / name) as path:
            write_plot_page(path, title, list_.trees, list_.rejected, notes)
        files[name] = "stem map, diameters, slices"
    if facts.device_bias is not None:
        (folder / BIAS).write_bytes(msgspec.json.encode(facts.device_bias) + b"\n")
        files[BIAS] = "for other walks with the same device: --device-bias"
    if not (folder / EDITS).exists():
        (folder / EDITS).write_text(EDITS_HEAD + ",".join(EDIT_COLUMNS) + "\n", encoding="utf-8")
    files[EDITS] = "yours: confirm, add and delete trees; the next run begins with it"


def _pages(given: TreeList) -> list[tuple[str, str, TreeList]]:
    """Name, title and trees of each page."""
    if len(given.trees) <= MOST_ON_A_PAGE:
        return [("plot.html", "Inventory", given)]
    squares: dict[tuple[int, int], TreeList] = {}
    for tree in given.trees:
        squares.setdefault(_square(tree.position_m), TreeList([], [])).trees.append(tree)
    for one in given.rejected:
        if (square := _square(one.position_m)) in squares:
            squares[square].rejected.append(one)
    return [
        (f"plot_{x}_{y}.html", f"Inventory of the {PLOT_M:g} m square from {x} {y}", squares[x, y])
        for x, y in sorted(squares)
    ]


def _square(position_m: Sequence[float] | np.ndarray) -> tuple[int, int]:
    x, y = (int(np.floor(float(value) / PLOT_M) * PLOT_M) for value in position_m[:2])
    return x, y
