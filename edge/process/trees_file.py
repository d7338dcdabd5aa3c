"""Trees between the stages, and in the products, as msgpack."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from pipeline.trees import Tree, View

TREES, EVIDENCE, SEARCHED, FACTS = "trees.msgpack", "evidence.npz", "searched.npz", "grounding.json"
PICTURES = "pictures"


class GroundingFacts(msgspec.Struct):
    """views: images that were put on the map; blind: without a map around; lost: without a pose; boxes: of the target;
    unplaced: of these, on nothing of the map. notes: what has to be said."""

    target: str = ""
    frame: str = "odom"
    """Of trees and of what was searched: `map` or `odom`."""
    views: int = 0
    blind: int = 0
    lost: int = 0
    boxes: int = 0
    unplaced: int = 0
    trees: int = 0
    """Probable ones."""
    seconds: float = 0.0
    notes: tuple[str, ...] = ()


class _View(msgspec.Struct, frozen=True):
    stamp_ns: int
    box_px: tuple[float, float, float, float]
    confidence: float
    range_m: float


class _Tree(msgspec.Struct, frozen=True):
    """`Tree`, arrays as lists."""

    tree_id: int
    class_name: str
    frame: str
    position_m: list[float]
    covariance: list[list[float]]
    probability: float
    views: int
    hits: int
    points: int
    stem_seen: bool
    height_m: float | None
    crown_m: float | None
    first_ns: int
    last_ns: int
    best: list[_View]


def write_trees(path: Path, trees: Sequence[Tree]) -> None:
    """All of them, in the frame that they are in."""
    path.write_bytes(msgspec.msgpack.encode([_plain(tree) for tree in trees]))


def read_trees(path: Path) -> list[Tree]:
    """What `write_trees` wrote."""
    return [_tree(held) for held in msgspec.msgpack.decode(path.read_bytes(), type=list[_Tree])]


def _plain(tree: Tree) -> _Tree:
    return _Tree(
        tree.tree_id,
        tree.class_name,
        tree.frame,
        tree.position_m.tolist(),
        tree.covariance.tolist(),
        tree.probability,
        tree.views,
        tree.hits,
        tree.points,
        tree.stem_seen,
        None if np.isnan(tree.height_m) else tree.height_m,
        None if np.isnan(tree.crown_m) else tree.crown_m,
        tree.first_ns,
        tree.last_ns,
        [_View(view.stamp_ns, view.box_px, view.confidence, view.range_m) for view in tree.best],
    )


def _tree(held: _Tree) -> Tree:
    return Tree(
        held.tree_id,
        held.class_name,
        held.frame,
        np.array(held.position_m),
        np.array(held.covariance),
        held.probability,
        held.views,
        held.hits,
        held.points,
        held.stem_seen,
        np.nan if held.height_m is None else held.height_m,
        np.nan if held.crown_m is None else held.crown_m,
        held.first_ns,
        held.last_ns,
        tuple(View(view.stamp_ns, view.box_px, view.confidence, view.range_m) for view in held.best),
    )
