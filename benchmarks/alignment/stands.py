"""Made-up stands with truth: seen from the air, and from the ground in a frame that is off by a known transform."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import laspy
import numpy as np
import numpy.typing as npt
import pyproj
from scipy import ndimage
from scipy.spatial import cKDTree

from pipeline.alignment.transform import Transform

Array = npt.NDArray[np.float64]
Kind = Literal["mixed", "rows"]
CELL_M = 0.25
CRS = "EPSG:32633"


@dataclass(frozen=True, slots=True, eq=False)
class Stand:
    """trees: (n, 5) x, y, height, DBH (m), crown radius. top_m: (k, k) of the canopy in cells of `CELL_M`.

    middle_m: (2,) of the square of side_m.
    """

    trees: Array
    top_m: Array
    middle_m: Array
    side_m: float
    relief_m: float
    seed: int

    def ground_m(self, xy: Array) -> Array:
        """(n,) of places (n, 2): a slope with hollows."""
        x, y = ((xy - self.middle_m) / 10.0).T
        rough = np.sin(1.3 * x + self.seed) * np.cos(0.9 * y) + 0.4 * np.sin(2.9 * x + 2.3 * y)
        return np.asarray(500.0 + self.relief_m * (0.8 * x + 0.3 * y + 0.5 * rough))


def grow(kind: Kind, seed: int, *, side_m: float = 120.0, per_ha: float = 500.0, relief_m: float = 0.6) -> Stand:
    """mixed: trees of every size where there is room. rows: equal ones, every 3 m along rows 4 m apart."""
    rng = np.random.default_rng([seed, 7])
    middle = np.array([500_000.0, 5_400_000.0])
    if kind == "rows":
        steps = np.meshgrid(np.arange(0, side_m, 4.0), np.arange(0, side_m, 3.0), indexing="ij")
        xy = np.column_stack([one.ravel() for one in steps]) + rng.normal(0, 0.1, (steps[0].size, 2))
        height = rng.normal(18.0, 0.4, len(xy))
    else:
        xy = _apart(rng.uniform(0, side_m, (round(3 * per_ha * side_m**2 / 1e4), 2)), 1.5)
        xy = xy[: round(per_ha * side_m**2 / 1e4)]
        height = rng.uniform(8.0, 28.0, len(xy))
    dbh = 0.012 * height * rng.lognormal(0, 0.15, len(xy))
    radius = (0.11 * height + 0.3) * rng.lognormal(0, 0.12, len(xy))
    trees = np.column_stack([xy + middle - side_m / 2, height, dbh, radius])
    leaning = trees[:, :2] + rng.normal(0, 0.35, (len(trees), 2))
    return Stand(trees, _canopy(leaning, trees, middle, side_m), middle, side_m, relief_m, seed)


def from_the_air(stand: Stand, per_m2: float = 8.0) -> Array:
    """(n, 3): the canopy, and through it the ground now and then."""
    rng = np.random.default_rng([stand.seed, 11])
    xy = stand.middle_m + rng.uniform(-0.5, 0.5, (round(per_m2 * stand.side_m**2), 2)) * stand.side_m
    at = ((xy - stand.middle_m + stand.side_m / 2) / CELL_M - 0.5).T
    height = np.maximum(ndimage.map_coordinates(stand.top_m, at, order=1, mode="nearest"), 0.0)
    height *= np.where(rng.uniform(size=len(xy)) < 0.25, 0.0, 1.0 - 0.1 * rng.exponential(1.0, len(xy)).clip(0, 3))
    return np.column_stack([xy, stand.ground_m(xy) + height + rng.normal(0, 0.05, len(xy))])


def from_the_ground(
    stand: Stand,
    radius_m: float,
    off: Transform,
    *,
    crowns: bool,
    at_m: tuple[float, float] = (0, 0),
    walk: int = 0,
    missed: float = 0.0,
) -> Array:
    """(n, 3) within a radius about the middle plus at_m, moved by the inverse of `off`, which so is the truth.

    crowns: whether the upper crowns are seen too. walk: another one has other noise. missed: share of its stems.
    """
    rng = np.random.default_rng([stand.seed, 13, walk])
    middle = stand.middle_m + np.array(at_m)
    near = stand.trees[np.hypot(*(stand.trees[:, :2] - middle).T) < radius_m]
    near = near[rng.uniform(size=len(near)) >= missed]
    parts = [_disc(rng, middle, radius_m, round(25 * np.pi * radius_m**2))]
    parts[0] = np.column_stack([parts[0], stand.ground_m(parts[0]) + rng.normal(0, 0.04, len(parts[0]))])
    for x, y, height, dbh, _ in near:
        turn, up = rng.uniform(0, 2 * np.pi, 300), rng.uniform(0, min(0.6 * height, 9.0), 300)
        ring = np.column_stack([x + dbh / 2 * np.cos(turn), y + dbh / 2 * np.sin(turn)]) + rng.normal(
            0, 0.015, (300, 2)
        )
        parts.append(np.column_stack([ring, stand.ground_m(np.array([[x, y]]))[0] + up]))
    if crowns:
        xy = _disc(rng, middle, radius_m, round(10 * np.pi * radius_m**2))
        at = ((xy - stand.middle_m + stand.side_m / 2) / CELL_M - 0.5).T
        top = ndimage.map_coordinates(stand.top_m, at, order=1, mode="nearest")
        seen = top > 3.0
        up = top[seen] * (1.0 - 0.25 * rng.uniform(size=seen.sum()))
        parts.append(np.column_stack([xy[seen], stand.ground_m(xy[seen]) + up]))
    return off.inverse().apply(np.concatenate(parts))


def write_las(path: Path, xyz: Array, crs: str | None = CRS, kind: int = 0) -> Path:
    """A point cloud as others write it."""
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, 0.001), np.floor(xyz.mean(axis=0))
    if crs is not None:
        header.add_crs(pyproj.CRS.from_user_input(crs))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.classification = np.full(len(xyz), kind, np.uint8)
    las.write(path)
    return path


def _canopy(centres: Array, trees: Array, middle: Array, side_m: float) -> Array:
    count = round(side_m / CELL_M)
    line = (np.arange(count) + 0.5) * CELL_M - side_m / 2
    top = np.zeros((count, count))
    for (x, y), (height, radius) in zip(centres - middle, trees[:, [2, 4]], strict=True):
        i, j = (slice(*np.searchsorted(line, [at - radius, at + radius])) for at in (x, y))
        square = ((line[i, None] - x) ** 2 + (line[None, j] - y) ** 2) / radius**2
        np.maximum(top[i, j], np.where(square < 1.0, height * (1.0 - 0.45 * square), 0.0), out=top[i, j])
    return top


def _apart(xy: Array, least_m: float) -> Array:
    pairs = cKDTree(xy).query_pairs(least_m, output_type="ndarray")
    return np.delete(xy, np.unique(pairs.max(axis=1)), axis=0)


def _disc(rng: np.random.Generator, middle: Array, radius_m: float, count: int) -> Array:
    turn, out = rng.uniform(0, 2 * np.pi, count), radius_m * np.sqrt(rng.uniform(size=count))
    return np.asarray(middle + np.column_stack([out * np.cos(turn), out * np.sin(turn)]))
