"""A few man-made things beside the route: benches, a fence, signs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from drivers.sim.paths import STEP_M, Route
from drivers.sim.scene import Boxes, Made, Terrain, Trees

EVERY_M = 120.0
BESIDE_M = 2.2
CLEAR_M = 1.2
ELBOW_M = 0.9
SHIFTS_M = tuple(0.5 * k for k in range(30))
BAY_M = 2.4
BAYS = 6
WOOD, PAINT = 0.45, 0.75
Place = tuple[float, float, float, float]
Box = tuple[tuple[float, float, float], tuple[float, float, float], float, float, Made]


def furnish(route: Route, terrain: Terrain, trees: Trees, wanted: bool) -> Boxes:
    """A bench, a sign and a stretch of fence for each `EVERY_M` of the route, between the trees."""
    boxes = list(_all(_Side(route, terrain, trees))) if wanted else []
    return Boxes(
        centre_m=np.array([box[0] for box in boxes], np.float32).reshape(-1, 3),
        half_m=np.array([box[1] for box in boxes], np.float32).reshape(-1, 3),
        yaw_rad=np.array([box[2] for box in boxes], np.float32),
        reflectivity=np.array([box[3] for box in boxes], np.float32),
        made=np.array([box[4] for box in boxes], np.uint8),
    )


@dataclass(frozen=True, slots=True)
class _Side:
    """Places beside the route."""

    route: Route
    terrain: Terrain
    trees: Trees

    def at(self, along_m: float, left_m: float) -> Place:
        """x, y, ground, and the route's yaw there."""
        points = self.route.points_m
        k = min(int(along_m / STEP_M), len(points) - 2)
        ahead = points[k + 1] - points[k]
        yaw = float(np.arctan2(ahead[1], ahead[0]))
        x, y = points[k] + left_m * np.array([-np.sin(yaw), np.cos(yaw)])
        return float(x), float(y), float(self.terrain.height_at([x, y])[0]), yaw

    def free(self, along_m: float, left_m: float) -> Place:
        """The first such place at or after `along_m` without a tree within `CLEAR_M`."""
        places = [self.at(along_m + shift, left_m) for shift in SHIFTS_M]
        return next((place for place in places if self.room(place[0], place[1]) > CLEAR_M), places[0])

    def room(self, x: float, y: float) -> float:
        """Distance to the bark of the nearest stem, or to the walker's elbow."""
        to_bark = np.hypot(*(self.trees.position_m[:, :2] - (x, y)).T) - 0.5 * self.trees.dbh_m
        to_elbow = np.hypot(*(self.route.points_m - (x, y)).T) - ELBOW_M
        return float(min(to_bark.min(initial=np.inf), to_elbow.min()))


def _all(side: _Side) -> Iterator[Box]:
    length_m = side.route.length_m
    for k in range(max(1, round(length_m / EVERY_M))):
        start, span = k * EVERY_M, min(EVERY_M, length_m)
        yield from _bench(*side.free(start + 0.30 * span, BESIDE_M))
        yield from _sign(*side.free(start + 0.08 * span, -BESIDE_M))
        yield from _fence(side, start + 0.55 * span)


def _bench(x: float, y: float, ground: float, yaw: float) -> Iterator[Box]:
    left = np.array([-np.sin(yaw), np.cos(yaw)])
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    yield (x, y, ground + 0.45), (0.80, 0.22, 0.025), yaw, WOOD, Made.BENCH
    back = np.array([x, y]) + 0.24 * left
    yield (float(back[0]), float(back[1]), ground + 0.75), (0.80, 0.02, 0.14), yaw, WOOD, Made.BENCH
    for side in (-0.65, 0.65):
        leg = np.array([x, y]) + side * ahead
        yield (float(leg[0]), float(leg[1]), ground + 0.2), (0.04, 0.18, 0.23), yaw, WOOD, Made.BENCH


def _sign(x: float, y: float, ground: float, yaw: float) -> Iterator[Box]:
    yield (x, y, ground + 0.7), (0.04, 0.04, 0.8), yaw, WOOD, Made.SIGN
    yield (x, y, ground + 1.35), (0.03, 0.30, 0.20), yaw, PAINT, Made.SIGN


def _fence(side: _Side, along_m: float) -> Iterator[Box]:
    """Where a tree stands in the way, the post or rail is missing."""
    posts = [side.at(along_m + k * BAY_M, BESIDE_M) for k in range(BAYS + 1)]
    for x, y, ground, yaw in posts:
        if side.room(x, y) > 0.15:
            yield (x, y, ground + 0.5), (0.05, 0.05, 0.65), yaw, WOOD, Made.FENCE_POST
    for (x0, y0, g0, _), (x1, y1, g1, _) in pairwise(posts):
        half, yaw = 0.5 * float(np.hypot(x1 - x0, y1 - y0)), float(np.arctan2(y1 - y0, x1 - x0))
        if min(side.room(x0 + share * (x1 - x0), y0 + share * (y1 - y0)) for share in np.linspace(0, 1, 9)) < 0.3:
            continue
        for rail in (0.45, 0.95):
            middle = (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (g0 + g1) + rail)
            yield middle, (half, 0.02, 0.05), yaw, WOOD, Made.FENCE_RAIL
