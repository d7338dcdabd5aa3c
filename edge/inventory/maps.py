"""The map that is meant: a session's while it is between the stages, its LAZ, or anybody's file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from edge.config import Config
from edge.errors import FormatError
from edge.process import fusion_stage, odometry_stage, trees_file
from edge.process.fusion_stage import read_placement
from edge.process.trees_file import read_trees
from pipeline.inventory.diameter import COARSE_M
from pipeline.inventory.source import MapSource, open_map
from pipeline.inventory.tilemap import TileMap
from pipeline.products.tiles import tiles
from pipeline.products.track import read_track
from pipeline.trees import Tree

FOLDER = "inventory"


@dataclass(frozen=True, slots=True)
class Found:
    """detected: individuals of the session's detector, in the frame of the map, all of them; None where none looked."""

    source: MapSource
    folder: Path
    detected: list[Tree] | None
    notes: tuple[str, ...] = ()


def find_map(target: Path, config: Config) -> Found:
    """target: a session, its products, or a file. FormatError, InventoryError when there is no map in it."""
    if not target.is_dir():
        return Found(open_map(target), target.with_name(f"{target.name.partition('.')[0]}_{FOLDER}"), None)
    products = target / "products" if (target / "products").is_dir() else target
    work = products / "work"
    if (work / "odometry" / odometry_stage.TRACK).exists() and tiles(work / "odometry" / odometry_stage.TILES):
        return _of_stages(target, products, work, config)
    for name in ("map.laz", "map_local.laz"):
        if (products / name).exists():
            note = (
                "the map alone does not say where the scanner was: diameters are from circles; keep `work` for better"
            )
            return Found(open_map(products / name), products / FOLDER, None, (note,))
    raise FormatError(f"{target}: there is no map in it; run `mapforest process` first, or give a .laz, .las or .ply")


def _of_stages(target: Path, products: Path, work: Path, config: Config) -> Found:
    track = read_track(work / "odometry" / odometry_stage.TRACK)
    path = work / "fusion" / fusion_stage.PLACEMENT
    placement = read_placement(path) if path.exists() else None
    folder = work / "odometry" / odometry_stage.TILES
    name = target.absolute().name
    source = TileMap(folder, config.products.voxel_m, track["position_m"], placement, name)
    grounded, detected, notes = work / "grounding" / trees_file.TREES, None, []
    if grounded.exists():
        frame = "odom" if placement is None else placement.frame
        trees = read_trees(grounded)
        detected = [tree for tree in trees if tree.frame == frame]
        if len(detected) < len(trees):
            notes.append(f"{len(trees) - len(detected)} detections are in another frame than the map: process again")
    if config.products.voxel_m > COARSE_M:
        notes.append(
            f"the map keeps one point in {100 * config.products.voxel_m:g} cm: diameters come out too thick; process "
            "with products.voxel_m = 0.02 to measure them"
        )
    return Found(source, products / FOLDER, detected, tuple(notes))
