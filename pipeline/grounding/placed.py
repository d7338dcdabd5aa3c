"""Trees taken from the frame of the odometry to that of the map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pipeline.products.track import Placement
from pipeline.trees import Tree


def to_map(trees: list[Tree], placement: Placement, stamps_ns: npt.NDArray[np.int64]) -> list[Tree]:
    """Each by the placement at the middle of the time it was seen in; how well that is known adds to its covariance.

    stamps_ns: (n,) of the track that was placed.
    """
    return [_placed(tree, placement, stamps_ns) for tree in trees]


def _placed(tree: Tree, placement: Placement, stamps_ns: npt.NDArray[np.int64]) -> Tree:
    middle_ns = (tree.first_ns + tree.last_ns) // 2
    sweep = min(int(np.searchsorted(stamps_ns, middle_ns)), len(stamps_ns) - 1)
    position = placement.points(tree.position_m[None], np.array([sweep]))[0]
    turn = placement.rotation[sweep]
    covariance = turn @ tree.covariance @ turn.T + placement.covariance[sweep, :3, :3]
    return replace(tree, frame=placement.frame, position_m=position, covariance=covariance)
