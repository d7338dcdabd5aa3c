"""Wood and leaves on the trees of an inventory: stems, branches, clumps of leaves."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from drivers.sim.planting import BREAST_M
from drivers.sim.scene import Branches, Doubles, Foliage, Kind, Stems, Trees
from drivers.sim.species import TRAITS, Species

SUNK_M = 0.15
TOP_SHARE = 0.12
TAPE_M = (1.15, 1.35)
GOLDEN_RAD = 2.39996
Index = npt.NDArray[np.int64]


def stems(trees: Trees, rng: np.random.Generator) -> Stems:
    """One frustum a tree, its diameter at breast height exactly the inventory's."""
    base = trees.position_m - np.column_stack([trees.lean * SUNK_M, np.full(len(trees), SUNK_M)])
    top = trees.position_m + np.column_stack([trees.lean * trees.height_m[:, None], trees.height_m])
    radius = 0.5 * trees.dbh_m
    taper = radius * (1.0 - TOP_SHARE) / (trees.height_m - BREAST_M)
    bark = np.array([traits.bark for traits in TRAITS])[trees.species]
    tape = trees.position_m[:, 2:] + np.array(TAPE_M)
    return Stems(
        base_m=base.astype(np.float32),
        top_m=top.astype(np.float32),
        radius_base_m=(radius + taper * (BREAST_M + SUNK_M)).astype(np.float32),
        radius_top_m=(radius * TOP_SHARE).astype(np.float32),
        species=trees.species,
        reflectivity=(bark * rng.uniform(0.85, 1.15, len(trees))).astype(np.float32),
        tape_m=np.where(trees.taped[:, None], tape, np.nan).astype(np.float32),
    )


def branches(trees: Trees, rng: np.random.Generator) -> Branches:
    """Branches wind around each stem, from dead stubs below the crown to its top."""
    count = np.clip(4 + 30 * trees.dbh_m, 4, 14).astype(np.int64)
    tree, rank = _spread(count)
    share = (rank + rng.uniform(0.2, 0.8, len(tree))) / count[tree]
    low = 0.55 * trees.crown_base_m[tree]
    height = low + share * (0.95 * trees.height_m[tree] - low)
    dead = height < trees.crown_base_m[tree]
    reach = np.where(dead, 0.35, _profile(trees, tree, height)) * trees.crown_radius_m[tree] * rng.uniform(0.6, 1.0)
    bearing = GOLDEN_RAD * rank + tree * 1.7
    rise = np.where(trees.species[tree] == Species.PINE, rng.uniform(-0.1, 0.25), rng.uniform(0.3, 0.9, len(tree)))
    start = _axis(trees, tree, height)
    end = start + reach[:, None] * np.stack([np.cos(bearing), np.sin(bearing), rise], axis=1)
    end[:, 2] = np.minimum(end[:, 2], trees.position_m[tree, 2] + trees.height_m[tree])
    bark = np.array([traits.bark for traits in TRAITS])[trees.species[tree]]
    return Branches(
        start_m=start.astype(np.float32),
        end_m=end.astype(np.float32),
        radius_m=np.clip(0.07 * trees.dbh_m[tree] * (1.2 - share), 0.006, 0.05).astype(np.float32),
        species=trees.species[tree],
        reflectivity=bark.astype(np.float32),
        tree=tree.astype(np.int32),
    )


def crowns(trees: Trees, wood: Branches, rng: np.random.Generator) -> Foliage:
    """A clump at the end of each living branch, one half-way, and a top. Pinnate species: rosettes of fronds."""
    living = wood.start_m[:, 2] - trees.position_m[wood.tree, 2] > 0.85 * trees.crown_base_m[wood.tree]
    ends, halves = wood.end_m[living], (0.45 * wood.start_m + 0.55 * wood.end_m)[living]
    out = (wood.end_m - wood.start_m)[living]
    everyone = np.arange(len(trees))
    tops = _axis(trees, everyone, 0.97 * trees.height_m)
    up = np.tile(np.array([0.0, 0.0, 1.0]), (len(trees), 1))
    tree = np.concatenate([wood.tree[living], wood.tree[living], everyone]).astype(np.int64)
    centre = np.concatenate([ends, halves, tops])
    frond = np.concatenate([out, out, up])
    clump = np.full(len(tree), 0.40) * trees.crown_radius_m[tree]
    clump = np.clip(clump, 0.30, 1.5) * rng.uniform(0.75, 1.25, len(tree))
    pinnate = np.array([traits.frond_m for traits in TRAITS])[trees.species[tree]] > 0.0
    clump = np.where(pinnate, np.clip(clump, 0.35, 0.9), clump)
    chosen = (rng.random(len(tree)) < 0.9) | (np.arange(len(tree)) >= 2 * len(ends))
    return clumps(
        centre[chosen],
        np.stack([clump, 0.65 * clump], axis=1)[chosen],
        species=trees.species[tree][chosen],
        kind=Kind.CROWN,
        tree=tree[chosen],
        frond=frond[chosen],
        rng=rng,
    )


def clumps(
    centre: npt.NDArray[np.floating],
    semi_axes: Doubles,
    *,
    species: npt.NDArray[np.uint8],
    kind: Kind,
    tree: Index,
    frond: npt.NDArray[np.floating],
    rng: np.random.Generator,
) -> Foliage:
    """Clumps of one kind, with what their species says of density, brightness and fronds."""
    count = len(species)

    def trait(name: str) -> Doubles:
        return np.array([getattr(traits, name) for traits in TRAITS])[species]

    length = np.linalg.norm(frond, axis=1, keepdims=True)
    return Foliage(
        centre_m=centre.astype(np.float32),
        semi_axes_m=semi_axes.astype(np.float32),
        extinction_per_m=(trait("extinction_per_m") * rng.uniform(0.7, 1.3, count)).astype(np.float32),
        reflectivity=(trait("foliage") * rng.uniform(0.85, 1.15, count)).astype(np.float32),
        species=species,
        kind=np.full(count, kind, np.uint8),
        tree=tree.astype(np.int32),
        frond=(frond / np.maximum(length, 1e-9)).astype(np.float32),
        frond_m=(trait("frond_m") * rng.uniform(0.75, 1.15, count)).astype(np.float32),
    )


def _spread(count: Index) -> tuple[Index, Index]:
    """Owner and rank within the owner of `count[i]` things of each owner i."""
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)


def _axis(trees: Trees, tree: Index, height: Doubles) -> Doubles:
    offset = np.column_stack([trees.lean[tree] * height[:, None], height])
    return np.asarray(trees.position_m[tree] + offset)


def _profile(trees: Trees, tree: Index, height: Doubles) -> Doubles:
    """Crown radius at a height, as a share of its largest: a cone for pine, a half ellipse for the others."""
    up = (height - trees.crown_base_m[tree]) / np.maximum(trees.height_m[tree] - trees.crown_base_m[tree], 0.1)
    up = np.clip(up, 0.0, 1.0)
    round_crown = np.sqrt(np.maximum(1.0 - (1.4 * (up - 0.35)) ** 2, 0.05))
    return np.asarray(np.where(trees.species[tree] == Species.PINE, 1.0 - 0.9 * up, round_crown))
