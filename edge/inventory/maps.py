"""The map that is meant: a session's while it is between the stages, its LAZ, or anybody's file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec

from edge.config import Config
from edge.errors import EdgeError, FormatError
from edge.inventory.fine import FINE_M
from edge.process import fusion_stage, odometry_stage, refine, trees_file
from edge.process.fusion_stage import read_placement
from edge.process.odometry_stage import OdometryFacts
from edge.process.places import Places
from edge.process.trees_file import read_trees
from edge.words import duration
from pipeline.inventory.diameter import COARSE_M
from pipeline.inventory.map_file import open_map
from pipeline.inventory.source import MapSource
from pipeline.inventory.tilemap import TileMap
from pipeline.products.tiles import tiles
from pipeline.products.track import read_track
from pipeline.trees import Tree

FOLDER = "inventory"


@dataclass(frozen=True, slots=True)
class Session:
    """What a map's stages left. recording: its folder or files; nothing where it is not beside the products."""

    name: str
    recording: tuple[Path, ...]
    places: Places


@dataclass(frozen=True, slots=True)
class Found:
    """detected: individuals of the session's detector, in the frame of the map, all of them; None where none looked.
    session: None for a map alone."""

    source: MapSource
    folder: Path
    detected: list[Tree] | None
    notes: tuple[str, ...] = ()
    session: Session | None = None


def find_map(target: Path, config: Config, remap: Callable[[Session], Path] | None = None) -> Found:
    """target: a session, its products, those of its refinement, or a file. remap: makes another map of the session in
    the form of the odometry stage, and says in which folder.

    FormatError, InventoryError when there is no map in it; EdgeError where there is nothing to remap.
    """
    products = target / "products" if (target / "products").is_dir() else target
    session = _session(products) if target.is_dir() else None
    if session is not None:
        odometry = session.places.odometry if remap is None else remap(session)
        return _of_stages(target, products / FOLDER, session, odometry, config)
    if remap is not None:
        raise EdgeError(f"{target}: a session is mapped once more, with its `work` kept; run `mapforest process` first")
    if not target.is_dir():
        return Found(open_map(target), target.with_name(f"{target.name.partition('.')[0]}_{FOLDER}"), None)
    for name in ("map.laz", "map_local.laz"):
        if (products / name).exists():
            note = (
                "the map alone does not say where the scanner was: diameters are from circles; keep `work` for better"
            )
            return Found(open_map(products / name), products / FOLDER, None, (note,))
    raise FormatError(f"{target}: there is no map in it; run `mapforest process` first, or give a .laz, .las or .ply")


def _session(products: Path) -> Session | None:
    """None where the stages' files are not there."""
    first, own, of = products.absolute(), products / "work", ""
    places = Places.of(own)
    if first.name == refine.FOLDER:
        first, of = first.parent, ", refined"
        work = first / "work"
        places = Places(work / "odometry", own / "refinement", work / "detection", own / "grounding")
    there = (places.odometry / odometry_stage.TRACK).exists() and tiles(places.odometry / odometry_stage.TILES)
    name = first.parent.name if first.name == "products" else first.name.removesuffix("_products")
    return Session(name + of, _recording(first), places) if there else None


def _recording(products: Path) -> tuple[Path, ...]:
    """As `mapforest process` lays its products beside it."""
    if products.name == "products":
        return (products.parent,) if any(products.parent.glob("*.mcap")) else ()
    name = products.name.removesuffix("_products")
    return tuple(sorted(path for path in products.parent.glob("*.mcap") if path.name.partition(".")[0] == name))


def _of_stages(target: Path, folder: Path, session: Session, odometry: Path, config: Config) -> Found:
    """odometry: folder of the map, which may be another one than the first."""
    places, notes = session.places, list[str]()
    path = places.fusion / fusion_stage.PLACEMENT
    placement = read_placement(path) if path.exists() else None
    facts = msgspec.json.decode((odometry / odometry_stage.FACTS).read_bytes(), type=OdometryFacts)
    voxel_m = facts.voxel_m or config.products.voxel_m
    track = read_track(odometry / odometry_stage.TRACK)
    source = TileMap(odometry / odometry_stage.TILES, voxel_m, track["position_m"], placement, session.name)
    grounded, detected = places.grounding / trees_file.TREES, None
    if grounded.exists():
        frame = "odom" if placement is None else placement.frame
        trees = read_trees(grounded)
        detected = [tree for tree in trees if tree.frame == frame]
        if len(detected) < len(trees):
            notes.append(f"{len(trees) - len(detected)} detections are in another frame than the map: process again")
    if voxel_m > COARSE_M:
        notes.append(
            f"the map keeps one point in {100 * voxel_m:g} cm: diameters come out too thick. Measure them with "
            f"`mapforest inventory {target} --fine`: it maps the session once more at {100 * FINE_M:g} cm, in about "
            f"{duration(facts.seconds)}"
        )
    return Found(source, folder, detected, tuple(notes), session)
