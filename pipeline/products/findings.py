"""What the grounding hands to everything that writes products."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.products.coverage import CoverageGrid
from pipeline.products.tiles import Tile
from pipeline.trees import Tree

LABELS = {0: "none", 1: "ailanthus"}
"""Of points of the map."""


@dataclass(frozen=True, slots=True)
class Model:
    """The detector. demonstration: it learned from simulated images, and what it says of real ones means nothing."""

    name: str
    sha256: str
    demonstration: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class PointEvidence:
    """Of n points of the map, (n,) each. probability: 0..1 that it belongs to the tree that is looked for, without
    meaning where `seen` is 0. label: of LABELS. seen: images in which the point stood unhidden.
    """

    probability: npt.NDArray[np.float32]
    label: npt.NDArray[np.uint8]
    seen: npt.NDArray[np.uint16]


Evidence = Callable[[Tile, npt.NDArray[np.void]], PointEvidence]
"""Of the points of a tile, in the order of `read_tile`."""


@dataclass(frozen=True, slots=True, eq=False)
class Findings:
    """frame: `map`, `local` or `odom`, of the trees and of the coverage. images: how many the detector looked at.

    chips: tree_id -> JPEG of its best view.
    """

    frame: str
    trees: Sequence[Tree]
    model: Model
    images: int
    coverage: CoverageGrid = field(default_factory=CoverageGrid)
    chips: Mapping[int, Path] = field(default_factory=dict)
    evidence: Evidence | None = None

    @property
    def positions_m(self) -> npt.NDArray[np.float64]:
        """(n, 3) of the trees."""
        return np.array([tree.position_m for tree in self.trees], np.float64).reshape(-1, 3)
