"""Where the trees are in a rendered picture: what a careful annotator would draw, and what he would leave open.

For training and for evaluation only; no driver and no algorithm sees it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.sim.render_kernels import FAR_M, NOTHING_M
from drivers.sim.renderer import Renderer
from drivers.sim.scene import Doubles, Trees
from drivers.sim.species import Species

Mask = npt.NDArray[np.bool_]
SAME_DEPTH = np.float32(1.0 + 1e-6)
"""Depths are kept in single precision: a surface drawn twice may differ in the last digit."""


@dataclass(frozen=True, slots=True, eq=False)
class TreeBoxes:
    """The trees of which a picture shows anything, nearest first.

    tree, species: (n,) row of the inventory, `Species`. range_m: (n,) from the camera to the foot, in plan.
    boxes_px: (n, 4) x_min, y_min, x_max, y_max of the visible pixels' outer edges, in 0..width and 0..height.
    visible_px: (n,) visible pixels. visible_share: (n,) of those the picture would show if nothing hid the tree.
    """

    tree: npt.NDArray[np.int64]
    species: npt.NDArray[np.uint8]
    range_m: Doubles
    boxes_px: Doubles
    visible_px: npt.NDArray[np.int64]
    visible_share: Doubles

    def __len__(self) -> int:
        return len(self.tree)

    def __getitem__(self, rows: Mask) -> TreeBoxes:
        return TreeBoxes(**{name: getattr(self, name)[rows] for name in self.__slots__})


@dataclass(frozen=True, slots=True)
class Annotation:
    """What of a tree must be seen for it to count. One that shows less is neither a miss nor a false alarm."""

    within_m: float = 20.0
    visible_px: int = 300
    visible_share: float = 0.25

    def counts(self, boxes: TreeBoxes) -> Mask:
        """(n,) which of the boxes do."""
        enough = (boxes.visible_px >= self.visible_px) & (boxes.visible_share >= self.visible_share)
        return np.asarray(enough & (boxes.range_m <= self.within_m))


def tree_boxes(
    renderer: Renderer, trees: Trees, within_m: float = FAR_M, species: Collection[Species] = tuple(Species)
) -> TreeBoxes:
    """Of the trees of some species, about a millisecond each, in the renderer's last picture."""
    distance = np.hypot(*(trees.position_m[:, :2] - renderer.eye_m[:2]).T)
    near = np.flatnonzero((distance < within_m) & np.isin(trees.species, list(species)))
    rows = []
    for tree in near[np.argsort(distance[near])].tolist():
        alone = renderer.depth_alone_m(tree)
        drawn = alone < NOTHING_M
        visible = drawn & (alone <= renderer.depth_m * SAME_DEPTH)
        if visible.any():
            rows.append((tree, *_around(visible), np.count_nonzero(visible), np.count_nonzero(drawn)))
    table = np.array(rows, dtype=np.float64).reshape(-1, 7)
    tree_row, visible_px = table[:, 0].astype(np.int64), table[:, 5]
    return TreeBoxes(
        tree=tree_row,
        species=trees.species[tree_row],
        range_m=distance[tree_row],
        boxes_px=table[:, 1:5],
        visible_px=visible_px.astype(np.int64),
        visible_share=visible_px / table[:, 6],
    )


def _around(visible: Mask) -> tuple[int, int, int, int]:
    columns, rows = np.flatnonzero(visible.any(axis=0)), np.flatnonzero(visible.any(axis=1))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
