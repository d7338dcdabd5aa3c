"""Alignments beside the true ones."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from pipeline.alignment.result import ALIGNED, Result
from pipeline.alignment.transform import Transform, wrapped_deg

NEAR_M, NEAR_DEG = 1.5, 3.0
"""What counts as found."""


class AlignmentErrors(msgspec.Struct, frozen=True):
    """Of one alignment, at the middle of the footprint. normalised: squared error over covariance, of plan and turn; 3
    is expected. up_m: NaN where heights are not known.
    """

    horizontal_m: float
    up_m: float
    turn_deg: float
    normalised: float
    said: str

    @property
    def near(self) -> bool:
        """Within what counts as found."""
        return self.horizontal_m <= NEAR_M and abs(self.turn_deg) <= NEAR_DEG


class AlignmentSummary(msgspec.Struct, frozen=True):
    """Of many. right, wrong: of those said to be aligned, by what counts as found. refused: the others."""

    count: int
    near: int
    right: int
    wrong: int
    refused: int
    median_m: float
    worst_m: float
    median_deg: float
    median_up_m: float
    normalised: float


def alignment_errors(found: Result, true: Transform) -> AlignmentErrors:
    """true: takes the same coordinates to those of the aerial map."""
    here = np.array([[*found.pivot_m, 0.0]])
    off = (found.transform.apply(here) - true.apply(here))[0]
    turn = wrapped_deg(found.yaw_deg - true.yaw_deg)
    covariance = np.array(found.covariance, dtype=np.float64)[np.ix_([0, 1, 3], [0, 1, 3])]
    error = np.array([off[0], off[1], math.radians(turn)])
    return AlignmentErrors(
        horizontal_m=float(np.hypot(off[0], off[1])),
        up_m=float(off[2]) if found.z_m is not None else math.nan,
        turn_deg=turn,
        normalised=float(error @ np.linalg.solve(covariance, error)),
        said=found.verdict,
    )


def summary(errors: Sequence[AlignmentErrors]) -> AlignmentSummary:
    """n > 0. Errors over all of them, whatever they said of themselves."""
    said = [one for one in errors if one.said == ALIGNED]
    metres = np.array([one.horizontal_m for one in errors])
    ups = np.abs([one.up_m for one in errors])
    return AlignmentSummary(
        count=len(errors),
        near=sum(one.near for one in errors),
        right=sum(one.near for one in said),
        wrong=sum(not one.near for one in said),
        refused=len(errors) - len(said),
        median_m=float(np.median(metres)),
        worst_m=float(metres.max()),
        median_deg=float(np.median(np.abs([one.turn_deg for one in errors]))),
        median_up_m=float(np.nanmedian(ups)) if np.isfinite(ups).any() else math.nan,
        normalised=float(np.mean([one.normalised for one in errors])),
    )
