"""The board among the LiDAR's points: the plane nearest to where the camera says it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.calibration.turning import Array

SLACK_M = 0.25
"""Guesses of the camera's pose are a few degrees and centimetres wrong: 0.2 m at 3 m."""
LEAST_POINTS = 120
THICK_M = 0.04
"""Points of the board scatter by 1 to 2 cm along the beam."""
MOST_TURNED_DEG = 25.0
LEAST_FILLED = 0.35
"""A plane that shows less of the board's area is something else, or half hidden."""


RIM_M = 0.02
"""Beams spread to 1 cm at 3 m, and half of one that meets an edge goes on."""


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where the board should be: its pose in `livox_frame`. corners_m: (4, 2) its outline in its own plane."""

    rotation: Array
    origin_m: Array
    corners_m: Array

    @property
    def normal(self) -> Array:
        """(3,)."""
        return np.asarray(self.rotation[:, 2])

    @property
    def centre_m(self) -> Array:
        """(3,)."""
        return np.asarray(self.rotation[:, :2] @ self.corners_m.mean(axis=0) + self.origin_m)

    @property
    def radius_m(self) -> float:
        """From the centre to a corner."""
        return float(np.linalg.norm(self.corners_m - self.corners_m.mean(axis=0), axis=1).max())


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A flat thing as the LiDAR sees it. centre_m, normal: (3,). axes: (2, 3) in the plane; spread_m: (2,) along them.

    thickness_m: RMS off the plane. The normal points to the LiDAR.
    """

    centre_m: Array
    normal: Array
    axes: Array
    spread_m: Array
    thickness_m: float
    points: int


def find_patch(points_m: Array, place: Place, seed: int = 0) -> Patch | None:
    """The board among points (n, 3), where it roughly should be. None: not there."""
    near = points_m[np.linalg.norm(points_m - place.centre_m, axis=1) < place.radius_m + SLACK_M]
    if len(near) < LEAST_POINTS:
        return None
    inliers = _plane(near, place.normal, np.random.default_rng(seed))
    for _ in range(3):
        if len(inliers) < LEAST_POINTS:
            return None
        patch = _fit(inliers)
        # Grass and hands lie in the plane as well; they are not where the middle of it is.
        middle = np.median(inliers, axis=0)
        flat = near[np.abs((near - patch.centre_m) @ patch.normal) < min(THICK_M, 3.0 * patch.thickness_m + 0.005)]
        inliers = flat[np.linalg.norm(flat - middle, axis=1) < 1.05 * place.radius_m]
    return patch if _plausible(patch, place) else None


def cut_patch(points_m: Array, place: Place) -> Patch | None:
    """The same where its place is known to a centimetre: hands at its edges, and what hangs there, are cut off."""
    low, high = place.corners_m.min(axis=0) + RIM_M, place.corners_m.max(axis=0) - RIM_M
    local = (points_m - place.origin_m) @ place.rotation
    on = points_m[np.all((local[:, :2] > low) & (local[:, :2] < high), axis=1) & (np.abs(local[:, 2]) < 2.0 * THICK_M)]
    for _ in range(4):
        if len(on) < LEAST_POINTS:
            return None
        patch = _fit(on)
        kept = on[np.abs((on - patch.centre_m) @ patch.normal) < 3.0 * patch.thickness_m]
        if len(kept) == len(on):
            break
        on = kept
    return patch


def _plausible(patch: Patch, place: Place) -> bool:
    turned = np.degrees(np.arccos(np.clip(abs(patch.normal @ place.normal), 0.0, 1.0)))
    area = float(np.prod(np.ptp(place.corners_m, axis=0)))
    # Even cover of a rectangle has a spread of its side over sqrt(12).
    seen = 12.0 * float(np.prod(patch.spread_m))
    return bool(turned < MOST_TURNED_DEG and LEAST_FILLED * area < seen < 2.0 * area)


def _plane(points: Array, normal: Array, rng: np.random.Generator) -> Array:
    """Inliers of the plane with most points among those turned like the board (RANSAC)."""
    best: Array = points[:0]
    least = np.cos(np.radians(MOST_TURNED_DEG))
    for _ in range(200):
        a, b, c = points[rng.choice(len(points), 3, replace=False)]
        across = np.cross(b - a, c - a)
        length = float(np.linalg.norm(across))
        if length < 1e-4 or abs(across @ normal) < least * length:
            continue
        inliers = points[np.abs((points - a) @ across) < 0.02 * length]
        if len(inliers) > len(best):
            best = inliers
    return best


def _fit(points: Array) -> Patch:
    centre = points.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov((points - centre).T))
    normal = vectors[:, 0] * (-1.0 if vectors[:, 0] @ centre > 0 else 1.0)
    spread = np.sqrt(np.maximum(values, 0.0))
    return Patch(centre, normal, vectors[:, [2, 1]].T, spread[[2, 1]], float(spread[0]), len(points))
