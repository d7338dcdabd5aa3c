"""A few man-made things beside the route: benches, a fence, signs."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from drivers.sim.paths import STEP_M, Route
from drivers.sim.scene import Boxes, Made, Terrain

EVERY_M = 120.0
BESIDE_M = 2.2
BAY_M = 2.4
BAYS = 6
WOOD, PAINT = 0.45, 0.75
Box = tuple[tuple[float, float, float], tuple[float, float, float], float, float, Made]


def furnish(route: Route, terrain: Terrain, wanted: bool) -> Boxes:
    """A bench, a sign and a stretch of fence for each `EVERY_M` of the route, at least one of each."""
    boxes = list(_all(route, terrain)) if wanted else []
    return Boxes(
        centre_m=np.array([box[0] for box in boxes], np.float32).reshape(-1, 3),
        half_m=np.array([box[1] for box in boxes], np.float32).reshape(-1, 3),
        yaw_rad=np.array([box[2] for box in boxes], np.float32),
        reflectivity=np.array([box[3] for box in boxes], np.float32),
        made=np.array([box[4] for box in boxes], np.uint8),
    )


def _all(route: Route, terrain: Terrain) -> Iterator[Box]:
    for k in range(max(1, round(route.length_m / EVERY_M))):
        start = k * EVERY_M
        yield from _bench(*_beside(route, terrain, start + 0.30 * min(EVERY_M, route.length_m), BESIDE_M))
        yield from _sign(*_beside(route, terrain, start + 0.08 * min(EVERY_M, route.length_m), -BESIDE_M))
        yield from _fence(route, terrain, start + 0.55 * min(EVERY_M, route.length_m))


def _beside(route: Route, terrain: Terrain, along_m: float, left_m: float) -> tuple[float, float, float, float]:
    """x, y, ground, and the route's yaw there."""
    k = min(int(along_m / STEP_M), len(route.points_m) - 2)
    ahead = route.points_m[k + 1] - route.points_m[k]
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    x, y = route.points_m[k] + left_m * np.array([-np.sin(yaw), np.cos(yaw)])
    return float(x), float(y), float(terrain.height_at([x, y])[0]), yaw


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


def _fence(route: Route, terrain: Terrain, along_m: float) -> Iterator[Box]:
    posts = [_beside(route, terrain, along_m + k * BAY_M, BESIDE_M) for k in range(BAYS + 1)]
    for x, y, ground, yaw in posts:
        yield (x, y, ground + 0.5), (0.05, 0.05, 0.65), yaw, WOOD, Made.FENCE_POST
    for (x0, y0, g0, _), (x1, y1, g1, _) in pairwise(posts):
        half, yaw = 0.5 * float(np.hypot(x1 - x0, y1 - y0)), float(np.arctan2(y1 - y0, x1 - x0))
        for rail in (0.45, 0.95):
            middle = (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (g0 + g1) + rail)
            yield middle, (half, 0.02, 0.05), yaw, WOOD, Made.FENCE_RAIL
