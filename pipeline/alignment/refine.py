"""From a candidate to the top of its basin, and how flat that is: batches of poses between the cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.alignment.grid import Array
from pipeline.alignment.layers import samples
from pipeline.alignment.search import Candidate, Maps
from pipeline.alignment.torch_kernels import Kernels

MOST_SAMPLES = 20_000
SIDE = 5
ROUNDS = 7
SHRINK = 0.6
NODES, NARROWED = 13, 5
Score = Callable[[Array], Array]
"""(k,) of poses (k, 3): x, y in metres, yaw in degrees."""


@dataclass(frozen=True, slots=True, eq=False)
class Basin:
    """The top, and the covariance (3, 3) of x, y (m) and yaw (rad) that the scores around it amount to."""

    top: Candidate
    covariance: Array


def joint_score(maps: Maps, kernels: Kernels) -> Score:
    """The sum of all layers' nats at any pose."""
    drawn = [samples(one, maps.moving, maps.pivot_m, MOST_SAMPLES) for one in maps.layers]
    thinned = [one.seen.sum() / max(len(index), 1) for one, (_, index) in zip(maps.layers, drawn, strict=True)]
    at = maps.fixed.fractional(maps.pivot_m)

    def score(poses: Array) -> Array:
        moved = in_cells(poses, at, maps.fixed.cell_m)
        total = np.zeros(len(poses))
        for one, (xy, index), times in zip(maps.layers, drawn, thinned, strict=True):
            values = np.ascontiguousarray(one.moving.ravel()[index])
            total += one.nats(kernels.sums(xy, values, one.fixed, one.known, moved) * times)
        return total

    return score


def in_cells(poses: Array, pivot: Array, cell_m: float) -> Array:
    """Poses (k, 3) in metres and degrees -> as the kernels take them; pivot: (2,) in cells of the fixed grid."""
    return np.column_stack([poses[:, :2] / cell_m + pivot, np.radians(poses[:, 2])])


def climb(score: Score, start: Candidate, step_m: float, step_deg: float) -> Candidate:
    """To the top near `start`: ever smaller boxes of poses, each about the best of the last. It cannot leave."""
    best = start
    for _ in range(ROUNDS):
        poses = box(best, 2 * step_m, 2 * step_deg, SIDE)
        found = score(poses)
        k = int(np.argmax(found))
        x, y, yaw = poses[k].tolist()
        best = Candidate(x, y, yaw, float(found[k]))
        step_m, step_deg = step_m * SHRINK, step_deg * SHRINK
    return best


def spread(score: Score, top: Candidate, reach_m: float, reach_deg: float) -> Array:
    """(3, 3) covariance about the top, with the scores as log-likelihoods."""
    reach = np.array([reach_m, reach_m, np.radians(reach_deg)])
    for _ in range(NARROWED):
        poses = box(top, float(reach[0]), float(np.degrees(reach[2])), NODES)
        found = score(poses)
        weight = np.exp(found - found.max())
        off = (poses - [top.x_m, top.y_m, top.yaw_deg]) * [1.0, 1.0, np.pi / 180.0]
        covariance = np.asarray((off * weight[:, None]).T @ off / weight.sum())
        sigma = np.sqrt(np.diag(covariance))
        fine = sigma >= 2.0 * reach / (NODES - 1) * 0.5
        if fine.all():
            break
        # The box has to hold the hill, and the hill some of its nodes.
        reach[:2] = reach[:2] if fine[:2].any() else np.maximum(4.0 * sigma[:2].max(), reach[:2] / 4.0)
        reach[2] = reach[2] if fine[2] else max(4.0 * sigma[2], reach[2] / 4.0)
    return covariance


def box(about: Candidate, reach_m: float, reach_deg: float, side: int) -> Array:
    """(side^3, 3) poses."""
    line = np.linspace(-1.0, 1.0, side)
    x, y, yaw = np.meshgrid(line * reach_m, line * reach_m, line * reach_deg, indexing="ij")
    off = np.column_stack([x.ravel(), y.ravel(), yaw.ravel()])
    return np.asarray(off + np.array([about.x_m, about.y_m, about.yaw_deg]))
