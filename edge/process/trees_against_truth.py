"""Mapped trees of a session against the forest that the emulated payload was carried through."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from drivers.sim.boxes import Annotation
from drivers.sim.scenarios import WorldConfig
from drivers.sim.seen import from_way_m, seen_s
from drivers.sim.species import Species
from drivers.sim.world import World, build
from edge.errors import FormatError
from edge.process.against_truth import products_folder, simulated_way, walk_begins_ns, world_datum
from edge.process.product_facts import ProductFacts, read_facts
from edge.process.trees_file import TREES, read_trees
from pipeline.evaluation.trajectory import Trajectory, read_tum
from pipeline.evaluation.trees import TreeErrors, tree_errors
from pipeline.gnss.geodesy import Datum
from pipeline.trees import Tree

Array = npt.NDArray[np.float64]
WITHIN_M = 15.0
"""Of the way, and of the camera while it saw the tree: what should be found."""
SEEN_S = 1.0
"""By the camera, in sum."""


class ComparedTrees(msgspec.Struct, frozen=True):
    """on_the_earth: as handed out; None for a session without a place. beside_the_way: with the error of the trajectory
    taken off, so that it tells of detection and grounding alone."""

    on_the_earth: TreeErrors | None
    beside_the_way: TreeErrors


def compare_trees(target: Path, truth: Path, probable: float) -> ComparedTrees:
    """target: a session, or its products. truth: the folder that the emulated payload wrote. FormatError when they
    cannot be compared."""
    folder = products_folder(target)
    facts = read_facts(folder)
    if facts.findings is None:
        raise FormatError(f"{target}: no detector looked at its images; process it with `--detect MODEL`")
    path = folder / "work" / "grounding" / TREES
    if not path.exists():
        raise FormatError(f"{path}: not there; run `mapforest process` again, without --clean")
    trees = [tree for tree in read_trees(path) if tree.probability >= probable]
    way = _Way.of(folder, truth, facts)
    targets = _targets(_world(truth), way.within_ns(walk_begins_ns(truth, facts)))
    trees = [way.in_world(tree) for tree in trees]
    beside = [way.beside(tree) for tree in trees]
    return ComparedTrees(
        tree_errors(trees, *targets, probable=probable) if way.placed else None,
        tree_errors(beside, *targets, probable=probable),
    )


def _targets(world: World, within_ns: tuple[int, int]) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Places (n, 2) of all of the species, and (n,) which of them should be found."""
    which = world.trees.species == Species.TREE_OF_HEAVEN
    places = world.trees.position_m[which, :2]
    seen = seen_s(world, [Species.TREE_OF_HEAVEN], Annotation(within_m=WITHIN_M), within_ns)[which]
    return places, (seen >= SEEN_S) & (from_way_m(world, places) <= WITHIN_M)


def _world(truth: Path) -> World:
    path = truth / "world.json"
    try:
        return build(msgspec.convert(json.loads(path.read_bytes()), WorldConfig))
    except (OSError, ValueError) as error:
        raise FormatError(f"{path}: not what the emulated payload writes ({error})") from error


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """Estimated and true, in the simulated world's frame and session time; the estimate in `odom` where it has no place
    there."""

    estimate: Trajectory
    true: Trajectory
    turn: Array
    """(3, 3), and origin_m (3,): from the products' frame into the world's."""
    origin_m: Array
    placed: bool

    @classmethod
    def of(cls, products: Path, truth: Path, facts: ProductFacts) -> _Way:
        turn, origin_m, name = np.eye(3), np.zeros(3), facts.trajectory
        if facts.datum is not None:
            here, goal = Datum(*facts.datum), world_datum(truth)
            turn, origin_m = goal.turn.T @ here.turn, goal.turn.T @ (here.origin_m - goal.origin_m)
        true = simulated_way(truth, facts)
        try:
            estimate = read_tum(products / name).moved(turn, origin_m).within(true)
        except ValueError as error:
            raise FormatError(f"{products / name} against {truth}: {error}") from error
        return cls(estimate, true, turn, origin_m, facts.datum is not None)

    def within_ns(self, begins_ns: int) -> tuple[int, int]:
        """Walk time that the estimate covers."""
        return int(self.estimate.stamps_ns[0]) - begins_ns, int(self.estimate.stamps_ns[-1]) - begins_ns

    def in_world(self, tree: Tree) -> Tree:
        return replace(
            tree,
            position_m=self.turn @ tree.position_m + self.origin_m,
            covariance=self.turn @ tree.covariance @ self.turn.T,
        )

    def beside(self, tree: Tree) -> Tree:
        """Where the tree would be if the pose that it was seen from, in the middle of that time, were the true one."""
        middle_ns = (tree.first_ns + tree.last_ns) // 2
        stamp = np.clip([middle_ns], self.estimate.stamps_ns[0], self.estimate.stamps_ns[-1])
        said, true = self.estimate.at(stamp), self.true.at(stamp)
        turn = true.rotations[0] @ said.rotations[0].T
        return replace(
            tree,
            position_m=turn @ (tree.position_m - said.positions_m[0]) + true.positions_m[0],
            covariance=turn @ tree.covariance @ turn.T,
        )
