"""A hypothesis as a `Tree`: its stem, its height and width, and all that its place may be off by."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.grounding.evidence import Evidence
from pipeline.grounding.ground import Ground
from pipeline.grounding.hypotheses import NEAR_SIDE_M, Hypothesis
from pipeline.grounding.likelihood import probability
from pipeline.grounding.surroundings import PointSource
from pipeline.trees import Tree

Array = npt.NDArray[np.float64]
BASE_SIGMA_M = 0.15
CROWN_M = 4.0
AROUND_M = 14.0
"""From the camera's height: a tall crown's top is in it."""
LEAST_POINTS = 20


def tree_of(one: Hypothesis, number: int, class_name: str, source: PointSource, evidence: Evidence | None) -> Tree:
    """In `odom`. The covariance holds the place within the map at hand, not that of the map."""
    mean_range_m = one.ranges_m / max(one.hits, 1)
    lasting_m = float(np.hypot(one.lasting_rad * mean_range_m, one.lasting_m))
    # A stem stands in the map whatever the camera's calibration; only what boxes alone point at errs with it.
    covariance = one.covariance + (lasting_m**2 if one.layers == 0.0 else 0.0) * np.eye(2)
    if one.layers == 0.0:
        covariance = covariance + NEAR_SIDE_M**2 * np.eye(2)
    place = np.array([*one.mean_m, one.height_m])
    near = source.around(place, AROUND_M)
    base_m, points, height_m, crown_m = one.height_m, 0, np.nan, np.nan
    if len(near):
        near = near[((near[:, :2] - one.mean_m) ** 2).sum(axis=1) < CROWN_M**2]
    if len(near):
        ground = Ground.under(near)
        base_m = float(ground.at(one.mean_m[None])[0])
        points, height_m, crown_m = _extent(near, ground, one.mean_m, evidence)
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[2, 2] = covariance, BASE_SIGMA_M**2
    return Tree(
        tree_id=number,
        class_name=class_name,
        frame="odom",
        position_m=np.array([*one.mean_m, base_m]),
        covariance=whole,
        probability=probability(one.log_odds),
        views=one.views,
        hits=one.hits,
        points=points,
        stem_seen=one.layers > 0.0,
        height_m=float(height_m),
        crown_m=float(crown_m),
        first_ns=one.first_ns,
        last_ns=one.last_ns,
        best=tuple(one.best),
    )


def _extent(near_m: Array, ground: Ground, place_m: Array, evidence: Evidence | None) -> tuple[int, float, float]:
    """Points that carry the label, of those near a place, how high they reach, and how wide."""
    if evidence is None:
        return 0, np.nan, np.nan
    labelled = near_m[evidence.at(near_m).log_odds > 0.0]
    if len(labelled) < LEAST_POINTS:
        return len(labelled), np.nan, np.nan
    away = np.linalg.norm(labelled[:, :2] - place_m, axis=1)
    height = labelled[:, 2] - ground.at(labelled[:, :2])
    return len(labelled), float(np.percentile(height, 99)), 2.0 * float(np.percentile(away, 80))
