"""Where the LiDAR sees a near thing end before a far one: stems, branches, posts, as points with a direction.

Everything is done in the angles of a pinhole at the LiDAR that looks like the camera; the guess of its rotation is good
enough to choose the points that the camera may see, and their directions in the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pipeline.calibration.extrinsics import Extrinsics
from pipeline.calibration.turning import Array
from pipeline.camera import CameraModel

NEIGHBOURS = 24
LEAST_NEAR, LEAST_FAR = 8, 3
FARTHEST_M = 25.0
"""Beyond it a stem is thinner than the beam."""
BEYOND = (1.08, 0.3)
"""Far: behind the point by so many times its range, and metres."""
SAME = (0.03, 0.12)
"""Near: within this share of its range, and metres."""
MARGIN_PX = 60.0
OUTERMOST_PX = 1.2
REACH_PX, ACROSS_PX, LEAST_ALONG = 30.0, 2.5, 2
"""An edge is a line: so many others on it, so near, that face the same way."""
CLUSTER_DEG, CLUSTER_SHARE = 4.0, 0.2


@dataclass(frozen=True, slots=True, eq=False)
class LaserEdges:
    """points_m: (n, 3) in `livox_frame`. outward: (n, 2) in the picture, from the near thing to the far one.

    cluster: (n,) number of the thing they are probably of; its points are wrong together.
    """

    points_m: Array
    outward: Array
    cluster: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.points_m)


def find_edges(points_m: Array, guess: Extrinsics, pinhole: CameraModel) -> LaserEdges:
    """Among points (n, 3) of some seconds of standing still."""
    focal = pinhole.focal_px[0]
    turned = points_m @ guess.rotation.T
    distance = np.linalg.norm(turned, axis=1)
    ahead = (turned[:, 2] > 0.3 * distance) & (distance > 0.6)
    at = np.full((len(turned), 2), np.inf)
    at[ahead] = focal * turned[ahead, :2] / turned[ahead, 2:]
    half = np.array([pinhole.width_px, pinhole.height_px]) / 2.0 + MARGIN_PX
    kept = np.all(np.abs(at) < half, axis=1)
    at, distance, points_m = at[kept], distance[kept], points_m[kept]
    if len(at) <= NEIGHBOURS:
        return LaserEdges(np.empty((0, 3)), np.empty((0, 2)), np.empty(0, np.int64))
    chosen, outward = _borders(at, distance)
    lined = _lined_up(at[chosen], outward)
    points, outward = points_m[chosen[lined]], outward[lined]
    return LaserEdges(points, outward, _clusters(points))


def _borders(at: Array, distance: Array) -> tuple[npt.NDArray[np.int64], Array]:
    """Rows that are the outermost of something near, and the direction in which it ends."""
    index = np.asarray(cKDTree(at).query(at, np.arange(1, NEIGHBOURS + 1))[1], np.int64)
    others, own = distance[index], distance[:, None]
    near = np.abs(others - own) < own * SAME[0] + SAME[1]
    far = others > own * BEYOND[0] + BEYOND[1]
    counted = (far.sum(axis=1) >= LEAST_FAR) & (near.sum(axis=1) >= LEAST_NEAR) & (distance < FARTHEST_M)
    rows = np.flatnonzero(counted)
    near, far, around = near[rows], far[rows], at[index[rows]]
    way = _mean(around, far) - _mean(around, near)
    length = np.linalg.norm(way, axis=1)
    clear = length > 2.0
    rows, near, around, way = rows[clear], near[clear], around[clear], way[clear] / length[clear, None]
    along = np.einsum("nki,ni->nk", around - at[rows][:, None], way)
    outermost = np.where(near, along, -np.inf).max(axis=1) < OUTERMOST_PX
    return rows[outermost], way[outermost]


def _mean(around: Array, which: npt.NDArray[np.bool_]) -> Array:
    weight = which[..., None]
    return np.asarray((around * weight).sum(axis=1) / weight.sum(axis=1))


def _lined_up(at: Array, outward: Array) -> npt.NDArray[np.bool_]:
    if not len(at):
        return np.zeros(0, bool)
    pairs = cKDTree(at).query_pairs(REACH_PX, output_type="ndarray")
    apart = at[pairs[:, 1]] - at[pairs[:, 0]]
    alike = np.einsum("ni,ni->n", outward[pairs[:, 0]], outward[pairs[:, 1]]) > 0.85
    counts = np.zeros(len(at), np.int64)
    for side in (0, 1):
        on = alike & (np.abs(np.einsum("ni,ni->n", apart, outward[pairs[:, side]])) < ACROSS_PX)
        np.add.at(counts, pairs[on, side], 1)
    return np.asarray(counts >= LEAST_ALONG)


def _clusters(points: Array) -> npt.NDArray[np.int64]:
    """By azimuth and range: a stem stands upright."""
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    ring = np.floor(np.log(np.linalg.norm(points, axis=1)) / CLUSTER_SHARE)
    return np.asarray(np.floor(azimuth / CLUSTER_DEG) * 100 + ring, np.int64)
