"""Mapped trees against those that are there: who was found, what was made up, and how far off the places are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from pipeline.trees import Tree

Array = npt.NDArray[np.float64]
WITHIN_M = 2.0
"""A mapped tree is the true one within this; farther off it is a false one, and the true one is missed."""
CHI2_2_95 = 5.991
TOO_FAR = 1e6


class TreeErrors(msgspec.Struct, frozen=True):
    """true: that should be found; found: of these; mapped: probable trees; right: of these, on a target that is there.

    A target that need not be found, being hidden or far, is right where it is found. Errors are of the right ones.
    """

    true: int
    found: int
    mapped: int
    right: int
    error_median_m: float
    error_worst_m: float
    within_95: float
    """Share of the true places within the stated 95 % ellipse, in plan."""
    nees: float
    """Mean normalised squared error in plan: 1 is honest."""
    sigma_median_m: float
    missed: tuple[int, ...] = ()
    """Rows of the true ones."""
    made_up: tuple[int, ...] = ()
    """`tree_id`s."""

    @property
    def recall(self) -> float:
        """NaN where there is nothing to find."""
        return self.found / self.true if self.true else float("nan")

    @property
    def precision(self) -> float:
        """NaN where nothing was mapped."""
        return self.right / self.mapped if self.mapped else float("nan")


def tree_errors(
    trees: Sequence[Tree],
    places_m: Array,
    wanted: npt.NDArray[np.bool_],
    *,
    probable: float = 0.5,
) -> TreeErrors:
    """places_m: (n, 2) of all targets; wanted: (n,) those that should be found. All in one frame."""
    mapped = [tree for tree in trees if tree.probability >= probable]
    found_m = np.array([tree.position_m[:2] for tree in mapped]).reshape(-1, 2)
    rows, cols = _paired(found_m, places_m)
    away = found_m[rows] - places_m[cols]
    spread = np.array([mapped[k].covariance[:2, :2] for k in rows]).reshape(-1, 2, 2)
    squared = np.einsum("ni,ni->n", away, np.linalg.solve(spread, away[..., None])[..., 0]) if len(rows) else away[:, 0]
    size = np.linalg.norm(away, axis=1)
    hit = np.zeros(len(places_m), np.bool_)
    hit[cols] = True
    return TreeErrors(
        true=int(wanted.sum()),
        found=int((hit & wanted).sum()),
        mapped=len(mapped),
        right=len(rows),
        error_median_m=_of(np.median, size),
        error_worst_m=_of(np.max, size),
        within_95=_of(np.mean, squared < CHI2_2_95),
        nees=_of(np.mean, squared / 2.0),
        sigma_median_m=_of(np.median, np.array([mapped[k].sigma_m for k in rows])),
        missed=tuple(np.flatnonzero(wanted & ~hit).tolist()),
        made_up=tuple(mapped[k].tree_id for k in sorted(set(range(len(mapped))) - set(rows.tolist()))),
    )


def _paired(found_m: Array, places_m: Array) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Each found one with one true one at most, within `WITHIN_M`, the sum of distances least."""
    if not len(found_m) or not len(places_m):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    away = np.linalg.norm(found_m[:, None] - places_m[None], axis=2)
    rows, cols = linear_sum_assignment(np.where(away < WITHIN_M, away, TOO_FAR))
    near = away[rows, cols] < WITHIN_M
    return rows[near], cols[near]


def _of(summary: Callable[..., Any], values: npt.NDArray[np.generic]) -> float:
    return float(summary(values)) if len(values) else float("nan")
