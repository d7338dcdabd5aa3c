"""Stems to crown tops by the largest set of matches whose distances agree (after Casseau et al. 2024), plainly."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from pipeline.alignment.scene import Scene
from pipeline.alignment.transform import Transform

Array = npt.NDArray[np.float64]
MOST_STEMS, MOST_CROWNS = 25, 60
TOLERANCE_M = 0.8
LEAST_CROWN_M = 8.0
STEPS = 40_000
"""Branches tried before the best clique so far is taken."""


def clique_pose(fixed: Scene, stems_m: Array, rank: Array, pivot: Array, reach_m: float) -> Transform | None:
    """The rigid transform of the largest clique; None with fewer than three matches.

    stems_m: (n, 2), of which those of the highest rank (n,) are taken.
    """
    assert fixed.canopy_m is not None
    stems = stems_m[np.argsort(-rank)[:MOST_STEMS]]
    crowns = _crowns(fixed, pivot, reach_m)
    near = np.linalg.norm(stems[:, None] - crowns[None], axis=2) <= reach_m
    i, j = np.nonzero(near)
    apart = [np.linalg.norm(one[:, None] - one[None], axis=2) for one in (stems[i], crowns[j])]
    agree = (np.abs(apart[0] - apart[1]) < TOLERANCE_M) & (i[:, None] != i) & (j[:, None] != j)
    best = _largest(agree)
    if len(best) < 3:
        return None
    return _rigid(stems[i[best]], crowns[j[best]], pivot)


def _crowns(fixed: Scene, pivot: Array, reach_m: float) -> Array:
    canopy = ndimage.gaussian_filter(fixed.canopy_m, 1.0)
    top = (canopy == ndimage.maximum_filter(canopy, size=7)) & (canopy > LEAST_CROWN_M)
    places, heights = fixed.grid.centres_m()[top], canopy[top]
    inside = np.linalg.norm(places - pivot, axis=1) < 25.0 + reach_m
    places, heights = places[inside], heights[inside]
    return places[np.argsort(-heights)[:MOST_CROWNS]]


def _largest(agree: npt.NDArray[np.bool_]) -> list[int]:
    """By branch and bound, most connected first, until the steps are used up."""
    rows = [int("".join("1" if one else "0" for one in row[::-1]), 2) for row in agree]
    best: list[int] = []
    steps = 0

    def grow(members: list[int], left: int) -> None:
        nonlocal best, steps
        steps += 1
        if len(members) > len(best):
            best = members
        while left and len(members) + left.bit_count() > len(best) and steps < STEPS:
            k = left.bit_length() - 1
            left &= ~(1 << k)
            grow([*members, k], left & rows[k])

    for start in np.argsort(-agree.sum(axis=1))[:200].tolist():
        grow([start], rows[start])
    return best


def _rigid(here: Array, there: Array, pivot: Array) -> Transform:
    a, b = here - here.mean(axis=0), there - there.mean(axis=0)
    yaw = np.degrees(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    turn = Transform((float(pivot[0]), float(pivot[1])), yaw_deg=float(yaw))
    x, y = (there.mean(axis=0) - turn.apply(here).mean(axis=0)).tolist()
    return Transform(turn.pivot_m, x, y, 0.0, float(yaw))
