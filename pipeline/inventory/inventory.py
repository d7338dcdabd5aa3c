"""The inventory of a map: ground, stems, diameters, heights and crowns, in bounded memory."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pipeline.inventory.blocks import LEAST_SIDE_M, MARGIN_M, MOST_POINTS, BlockStore
from pipeline.inventory.candidates import Layered
from pipeline.inventory.canopy import Canopy, CanopyBuilder
from pipeline.inventory.config import InventoryConfig
from pipeline.inventory.source import MapSource
from pipeline.inventory.stem import BREAST_M, Stem
from pipeline.inventory.stems import find_stems
from pipeline.inventory.terrain import Terrain, TerrainBuilder, TerrainPolish

Doubles = npt.NDArray[np.float64]
SHARES = {"ground": (0.0, 0.25), "heights": (0.25, 0.5), "stems": (0.5, 1.0)}
_SAME_M = 0.15
"""Two blocks found the same stem: their axes at breast height are closer than this."""


@dataclass(frozen=True, slots=True, eq=False)
class Inventory:
    """stems: by place, x first; rejected: those with a reason. base_m is from the map's origin. why: where there are no
    stems, what was there instead; empty otherwise."""

    terrain: Terrain
    canopy: Canopy
    stems: list[Stem]
    rejected: list[Stem]
    height_m: Doubles
    crown_m: Doubles
    why: str = ""


def take_inventory(
    source: MapSource,
    config: InventoryConfig,
    advance: Callable[[float], None] = lambda _: None,
    scratch: Path | None = None,
) -> Inventory:
    """Reads the map twice. advance: told the share that is done. scratch: folder for what does not fit memory."""
    first, side_m = _first_ground(source, config, advance)
    with tempfile.TemporaryDirectory(prefix="mapforest-inventory-", dir=scratch) as folder:
        store = BlockStore(Path(folder), side_m, config.highest_m + 1.0)
        polish, canopy = TerrainPolish(first), CanopyBuilder(first, config.canopy_cell_m)
        done = 0
        for part in source.parts():
            height = first.above(part.xyz_m)
            polish.add(part, height)
            canopy.add(part.xyz_m, height)
            store.add(part, height)
            done += len(part.xyz_m)
            _tell(advance, "heights", done / source.count)
        store.flush()
        terrain = polish.done()
        found = _stems(store, (first, terrain), source.voxel_m, config, advance)
    stems = sorted((s for s in found if not s.reason), key=lambda s: (s.base_m[0], s.base_m[1]))
    rejected = sorted((s for s in found if s.reason), key=lambda s: (s.base_m[0], s.base_m[1]))
    crowns = canopy.done(stems)
    heights, widths = crowns.sizes(stems)
    return Inventory(terrain, crowns, stems, rejected, heights, widths, _why(stems, rejected, store.kept, config))


def _first_ground(
    source: MapSource, config: InventoryConfig, advance: Callable[[float], None]
) -> tuple[Terrain, float]:
    """And the side of blocks that fit memory."""
    builder, done = TerrainBuilder(source, config), 0
    for part in source.parts():
        builder.add(part)
        done += len(part.xyz_m)
        _tell(advance, "ground", done / source.count)
    side_m = config.block_m
    while side_m >= 2.0 * LEAST_SIDE_M and builder.most_within(side_m + 2.0 * MARGIN_M) > MOST_POINTS:
        side_m /= 2.0
    return builder.first(), side_m


def _stems(
    store: BlockStore,
    grounds: tuple[Terrain, Terrain],
    voxel_m: float,
    config: InventoryConfig,
    advance: Callable[[float], None],
) -> list[Stem]:
    """Of all blocks, each stem once. grounds: that which the heights in the store are above, and the last one."""
    first, terrain = grounds
    found: list[Stem] = []
    blocks = store.blocks()
    for number, block in enumerate(blocks):
        points = store.read(block)
        xy = points["xyz"][:, :2].astype(np.float64)
        points["height"] += (first.at(xy) - terrain.at(xy)).astype(np.float32)
        for stem in find_stems(Layered.of(points), voxel_m, config):
            if store.owns(block, *stem.axis_at(BREAST_M)):
                ground = terrain.at(stem.base_m[None, :2])[0]
                found.append(replace(stem, base_m=np.array([*stem.base_m[:2], ground])))
        _tell(advance, "stems", (number + 1) / len(blocks))
    return _once(found)


def _once(stems: list[Stem]) -> list[Stem]:
    """On the border of two blocks both may have found a stem."""
    stems = sorted(stems, key=lambda stem: stem.reason != "")
    places = np.array([stem.axis_at(BREAST_M) for stem in stems]).reshape(-1, 2)
    kept = np.ones(len(stems), np.bool_)
    for first, second in sorted(cKDTree(places).query_pairs(_SAME_M)):
        if kept[first]:
            kept[second] = False
    return [stem for stem, stays in zip(stems, kept.tolist(), strict=True) if stays]


def _why(stems: list[Stem], rejected: list[Stem], points: int, config: InventoryConfig) -> str:
    if stems:
        return ""
    span = f"between {config.lowest_m:g} and {config.highest_m:g} m above the ground"
    if not points:
        return f"no points {span}: the map shows ground or canopy only"
    if not rejected:
        return f"nothing stands upright {span}, in {points:,} points"
    reasons = [stem.reason.split(";")[0] for stem in rejected]
    most = max(set(reasons), key=reasons.count)
    return f"{len(rejected)} places looked like stems and were rejected, most often: {most}"


def _tell(advance: Callable[[float], None], step: str, share: float) -> None:
    low, high = SHARES[step]
    advance(low + (high - low) * min(share, 1.0))
