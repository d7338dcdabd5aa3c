"""A ground map brought onto another: every turn and shift tried, the best answers climbed, the best of all judged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.errors import ApartError
from pipeline.alignment.grid import Array
from pipeline.alignment.layers import Layer
from pipeline.alignment.matching import STEMS, shared_layers
from pipeline.alignment.published import START_DEG, START_M, information_score, starts
from pipeline.alignment.refine import Score, climb, joint_score, spread
from pipeline.alignment.scene import Scene
from pipeline.alignment.search import COARSER, Advance, Candidate, Maps, candidates, coarser, sweep
from pipeline.alignment.torch_kernels import Kernels, kernels_on
from pipeline.alignment.transform import Transform
from pipeline.alignment.verdict import best_rival, chance_nats, doubts
from pipeline.alignment.vertical import Vertical, ground_to_ground

CANDIDATES, ANSWERS = 8, 500
"""Climbed, and looked at to learn how far chance carries one."""
BIAS_M, BIAS_RAD = 0.15, 0.005
"""Sigma of what cells and beams that see other sides of a crown do to every pose, however many trees there are."""
NEAR_BEST = 0.5
"""A candidate with less than this share of the best one's nats is not climbed: it gains half at most."""


@dataclass(frozen=True, slots=True)
class Share:
    """What one layer says. nats: for the pose found. independent: its independent observations."""

    name: str
    nats: float
    independent: float


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """transform: of the moved map, about the middle of its footprint. covariance: (4, 4) of x, y, z (m), yaw (rad).

    margin_nats: to the best other answer, or to none at all; asked_nats: what is asked of it.
    doubts: why it may not be believed; empty when it may.
    """

    transform: Transform
    covariance: Array
    vertical: Vertical | None
    margin_nats: float
    asked_nats: float
    rival: Candidate | None
    shares: Sequence[Share]
    overlap: float
    doubts: Sequence[str]

    @property
    def sure(self) -> bool:
        """Whether it may be believed."""
        return not self.doubts


def align(fixed: Scene, moved: Scene, config: AlignmentConfig, advance: Advance) -> Alignment:
    """Raises `ApartError` where the maps share nothing that could be compared."""
    kernels = kernels_on(config.device)
    layers = shared_layers(fixed, moved, config)
    if config.method == "nmi":
        layers = [one for one in layers if one.name == STEMS]
    if not layers:
        raise ApartError(_nothing(moved, config))
    maps = Maps(layers, fixed.grid, moved.grid, moved.grid.middle_m)
    score, found, steps = _answers(maps, config, kernels, advance)
    if not found:
        raise ApartError(
            f"nowhere within {config.search_m:g} m do {config.overlap:.0%} of the footprint of the ground map lie on "
            "the other map; get a larger piece of that one, or search farther"
        )
    worth = [one for one in found[:CANDIDATES] if one.nats >= NEAR_BEST * found[0].nats]
    climbed = [climb(score, one, *steps) for one in worth]
    top = max(climbed, key=lambda one: one.nats)
    rival = best_rival(top, [*climbed, *found[len(worth) :]], config)
    config = replace(config, margin_nats=config.margin_nats * chance_nats(found, config))
    flat = spread(score, top, config.rival_m, config.rival_deg) + np.diag(np.square([BIAS_M, BIAS_M, BIAS_RAD]))
    if [one.name for one in layers] == [STEMS] and fixed.stems_m is None:
        flat[0, 0] += config.crown_bias_m**2
        flat[1, 1] += config.crown_bias_m**2
    shift = Transform((float(maps.pivot_m[0]), float(maps.pivot_m[1])), top.x_m, top.y_m, 0.0, top.yaw_deg)
    vertical = ground_to_ground(fixed, moved, shift)
    stems = len(moved.stems_m) if [one.name for one in layers] == [STEMS] and moved.stems_m is not None else None
    return Alignment(
        transform=Transform(shift.pivot_m, top.x_m, top.y_m, vertical.shift_m if vertical else 0.0, top.yaw_deg),
        covariance=_with_height(flat, vertical),
        vertical=vertical,
        margin_nats=top.nats - (rival.nats if rival else 0.0),
        asked_nats=config.margin_nats,
        rival=rival,
        shares=[_share(maps, one, top, kernels) for one in layers],
        overlap=_overlap(fixed, moved, shift),
        doubts=doubts(top, rival, flat, stems, config),
    )


def _answers(
    maps: Maps, config: AlignmentConfig, kernels: Kernels, advance: Advance
) -> tuple[Score, list[Candidate], tuple[float, float]]:
    """The score, candidates of it, and steps in metres and degrees that their tops lie within."""
    if config.method == "nmi":
        score = information_score(maps, maps.layers[0], config, kernels)
        return (
            score,
            starts(score, config.search_m, config.search_deg, CANDIDATES, advance),
            (START_M / 2, START_DEG / 2),
        )
    landscape = sweep(coarser(maps, COARSER), config.search_m, config.search_deg, config.overlap, advance)
    step_deg = float(landscape.yaws_deg[1] - landscape.yaws_deg[0])
    return joint_score(maps, kernels), candidates(landscape, ANSWERS), (COARSER * config.cell_m / 2, step_deg / 2)


def _share(maps: Maps, one: Layer, top: Candidate, kernels: Kernels) -> Share:
    alone = Maps([one], maps.fixed, maps.moving, maps.pivot_m)
    nats = float(joint_score(alone, kernels)(np.array([[top.x_m, top.y_m, top.yaw_deg]]))[0])
    return Share(one.name, nats, float(one.seen.sum() * one.independent))


def _overlap(fixed: Scene, moved: Scene, flat: Transform) -> float:
    footprint = moved.looked if moved.looked.any() else moved.covered
    known = fixed.covered if fixed.covered.any() else fixed.looked
    cells, inside = fixed.grid.cells(flat.apply(moved.grid.centres_m()[footprint]))
    return float(np.mean(known.ravel()[cells] & inside))


def _with_height(flat: Array, vertical: Vertical | None) -> Array:
    """x, y, yaw -> x, y, z, yaw; without a ground z is not known at all."""
    found = np.zeros((4, 4))
    kept = np.ix_([0, 1, 3], [0, 1, 3])
    found[kept] = flat
    found[2, 2] = vertical.sigma_m**2 if vertical else math.inf
    return found


def _nothing(moved: Scene, config: AlignmentConfig) -> str:
    stems = 0 if moved.stems_m is None else len(moved.stems_m)
    if config.method == "nmi":
        return f"the published method compares stems alone, and there are {stems} of them; leave --method nmi out"
    return f"the ground map shows {stems} stems and too little ground or canopy to compare"
