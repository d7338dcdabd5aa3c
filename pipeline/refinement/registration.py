"""Two submaps laid on each other by small_gicp: the pose, and whether it is to be believed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.estimates import Array
from pipeline.odometry.config import DegeneracyConfig
from pipeline.odometry.degeneracy import observe
from pipeline.refinement.config import ClosureConfig
from pipeline.refinement.errors import LibraryMissing

try:
    import small_gicp
except ImportError as error:
    raise LibraryMissing(f"small_gicp cannot be loaded ({error}): install mapforest with the extra `refine`") from error

_LEAF_M = 0.35
_NEIGHBOURS = 12
_UPRIGHT = 0.7
"""Vertical part of a normal from which on a surface is ground."""
_SCOUTS = 3000
"""Points that look for the basin; all of them find its bottom."""
_COARSE_M, _FINE_M = 1.5, 0.5
"""Farthest correspondences."""
_COMMON_M = 20.0
"""From both middles: what is farther one of the two may not have seen."""
_RESIDUAL_M = 0.1
_EFFECTIVE = 100.0
"""So many residuals count as independent, each of `_RESIDUAL_M`: bark and leaves err alike."""


class Cloud:
    """A submap ready for registration: points (n, 3) in the frame of its keyframe."""

    def __init__(self, points_m: npt.NDArray[np.floating]) -> None:
        self.cloud, self.tree = small_gicp.preprocess_points(points_m.astype(np.float64), _LEAF_M, _NEIGHBOURS)
        self.points_m: Array = np.asarray(self.cloud.points())[:, :3]
        self.normals: Array = np.asarray(self.cloud.normals())[:, :3]
        self.upright_m = self.points_m[np.abs(self.normals[:, 2]) < _UPRIGHT]
        """Not of the ground, which fits itself everywhere."""
        step = max(len(self.points_m) // _SCOUTS, 1)
        self.scouts = small_gicp.PointCloud(np.ascontiguousarray(self.points_m[::step]))


@dataclass(frozen=True, slots=True, eq=False)
class Registered:
    """The source in the target's frame: pose (4, 4); covariance (6, 6), rotation, then position, axes of the source.

    overlap: share of common points, those of the ground left out, that are met. rival_m: to the next best pose that is
    nearly as good, or infinite. weak: whether the submaps leave a direction open.
    """

    pose: Array
    covariance: Array
    overlap: float
    rival_m: float
    weak: bool


def register(target: Cloud, source: Cloud, guesses: Sequence[Array], config: ClosureConfig) -> Registered:
    """From the best of some guesses (4, 4)."""
    basins = [_scouted(target, source, guess) for guess in guesses]
    scores = [_overlap(target, source, basin, config.inlier_m, _SCOUTS) for basin in basins]
    best = int(np.argmax(scores))
    pose = _aligned(target, source, basins[best])
    overlap, rival_m = _overlap(target, source, pose, config.inlier_m), _rival_m(basins, scores, best, config)
    covariance, weak = _certainty(target, source, pose, config)
    return Registered(pose, covariance, overlap, rival_m, weak)


def _scouted(target: Cloud, source: Cloud, guess: Array) -> Array:
    found = small_gicp.align(
        target.cloud,
        source.scouts,
        target.tree,
        guess,
        registration_type="PLANE_ICP",
        max_correspondence_distance=_COARSE_M,
        max_iterations=15,
    )
    return np.asarray(found.T_target_source)


def _aligned(target: Cloud, source: Cloud, guess: Array) -> Array:
    found = small_gicp.align(
        target.cloud,
        source.cloud,
        target.tree,
        guess,
        registration_type="GICP",
        max_correspondence_distance=_FINE_M,
        max_iterations=30,
    )
    return np.asarray(found.T_target_source)


def _overlap(target: Cloud, source: Cloud, pose: Array, within_m: float, most: int = 0) -> float:
    step = max(len(source.upright_m) // most, 1) if most else 1
    moved = _common(source.upright_m[::step], pose)
    if len(moved) < _NEIGHBOURS:
        return 0.0
    _, squared = target.tree.batch_nearest_neighbor_search(moved)
    return float(np.mean(np.asarray(squared) < within_m**2))


def _common(points: Array, pose: Array) -> Array:
    """(n, 3) those of the source's points that both may have seen, in the target's frame."""
    moved = points @ pose[:3, :3].T + pose[:3, 3]
    seen = (np.linalg.norm(points, axis=1) < _COMMON_M) & (np.linalg.norm(moved, axis=1) < _COMMON_M)
    return np.ascontiguousarray(moved[seen])


def _certainty(target: Cloud, source: Cloud, pose: Array, config: ClosureConfig) -> tuple[Array, bool]:
    """Covariance (6, 6), and whether a direction is weak: from the normals of what was met."""
    moved = _common(source.points_m, pose)
    floor = np.diag([math.radians(config.sigma_deg) ** 2] * 3 + [config.sigma_m**2] * 3)
    if len(moved) < _NEIGHBOURS:
        return floor, True
    index, squared = target.tree.batch_nearest_neighbor_search(moved)
    met = np.asarray(squared) < config.inlier_m**2
    normals = target.normals[np.asarray(index)[met]]
    if len(normals) < _NEIGHBOURS:
        return floor, True
    jacobian = np.hstack([np.cross(moved[met] - pose[:3, 3], normals), normals])
    information = jacobian.T @ jacobian * (_EFFECTIVE / len(normals) / _RESIDUAL_M**2)
    limits = DegeneracyConfig(attitude_rad=math.radians(config.weak_deg), position_m=config.weak_m)
    seen = observe(information, limits)
    turn = np.kron(np.eye(2), pose[:3, :3].T)
    covariance = turn @ np.linalg.inv(information + 1e-9 * np.eye(6)) @ turn.T + floor
    return covariance, seen.degenerate


def _rival_m(basins: Sequence[Array], scores: Sequence[float], best: int, config: ClosureConfig) -> float:
    far = [float(np.linalg.norm(basin[:3, 3] - basins[best][:3, 3])) for basin in basins]
    least = config.rival_share * scores[best]
    rivals = [d for d, score in zip(far, scores, strict=True) if d > config.rival_m and score >= least]
    return min(rivals, default=math.inf)
