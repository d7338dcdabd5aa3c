"""A carrier that goes round and round in a made-up stand: its odometry that drifts, its fixes, and its submaps.

Trunks are cylinders, the ground is bumpy, leaves are clumps of points; each visit samples them anew. What is behind
something is seen too: for loops that is no help, all is as it would be from elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.messages import FixQuality, GnssFix
from pipeline.estimates import Array, OdometryEstimate
from pipeline.gnss.geodesy import Datum
from pipeline.products.track import estimate_of, record_of
from pipeline.refinement.session import about_vertical
from pipeline.refinement.submaps import STRIDE_M, Submap, SubmapWriter, read_submaps

DATUM = Datum(47.0, 8.0, 500.0)
STEP_M, SPEED_M_S, SEEN_M = 0.5, 1.2, 20.0
NOISE_M = 0.02
DRIFT_M, DRIFT_DEG = 0.02, 0.03
"""After one metre, growing with its root; the odometry says so itself."""


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """seconds (n,), true positions (n, 3) and yaw (n,) in `map`; track: (n,) of ESTIMATE."""

    seconds: Array
    positions_m: Array
    yaw: Array
    track: np.ndarray

    def true_pose(self, k: int) -> Array:
        """(4, 4)."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = about_vertical(float(self.yaw[k])), self.positions_m[k]
        return pose


def rounds(length_m: float, radius_m: float, seed: int, drift: float = 1.0, begin_rad: float = 0.0) -> Walk:
    """drift: times the usual one. begin_rad: where on the circle."""
    way_m = np.arange(0.0, length_m, STEP_M)
    angle = way_m / radius_m + begin_rad
    positions = radius_m * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    yaw = angle + math.pi / 2.0
    return Walk(way_m / SPEED_M_S, positions, yaw, _odometry(way_m, positions, yaw, drift, seed))


def fixes(walk: Walk, seed: int, sigma_m: float = 0.5) -> list[GnssFix]:
    """One a second, with white errors that they tell of."""
    random, heard = np.random.default_rng((seed, 1)), []
    for k in range(0, len(walk.seconds), 2):
        place = DATUM.geodetic(walk.positions_m[k] + sigma_m * random.standard_normal(3))
        stamp = round(walk.seconds[k] * 1e9)
        quality = (12, 0.8, 1.0, (sigma_m, sigma_m, sigma_m), "gst")
        heard.append(GnssFix(stamp, stamp, 0, False, FixQuality.RTK_FLOAT, *place, 0.0, *quality))
    return heard


def stand(kind: str, reach_m: float, seed: int) -> Array:
    """(s, 3) x, y and radius of trunks: "dense", "open", or "rows"."""
    random = np.random.default_rng((seed, 2))
    if kind == "rows":
        x, y = np.meshgrid(np.arange(-reach_m, reach_m, 3.0), np.arange(-reach_m, reach_m, 2.0))
        trunks = np.column_stack([x.ravel(), y.ravel()])
        return np.column_stack([trunks + 0.05 * random.standard_normal(trunks.shape), np.full(len(trunks), 0.12)])
    count = round((0.1 if kind == "dense" else 0.02) * (2.0 * reach_m) ** 2)
    return np.column_stack([random.uniform(-reach_m, reach_m, (count, 2)), random.uniform(0.05, 0.25, count)])


def submaps(walk: Walk, trunks: Array, kind: str, folder: Path, seed: int) -> list[Submap]:
    """As `process` keeps them."""
    writer, random, last_m = SubmapWriter(folder), np.random.default_rng((seed, 3)), -np.inf
    for k in range(len(walk.track)):
        if walk.track["travelled_m"][k] - last_m >= STRIDE_M:
            last_m = walk.track["travelled_m"][k]
            seen = _seen(walk.positions_m[k], trunks, kind, random) - walk.positions_m[k]
            body = seen @ about_vertical(float(walk.yaw[k]))
            cloud = body @ walk.track["rotation"][k].T + walk.track["position_m"][k]
            writer.add(estimate_of(walk.track[k]), cloud.astype(np.float32), k)
    writer.close()
    return read_submaps(folder)


def _seen(place_m: Array, trunks: Array, kind: str, random: np.random.Generator) -> Array:
    near = trunks[np.linalg.norm(trunks[:, :2] - place_m[:2], axis=1) < SEEN_M]
    which = random.integers(0, len(near), 12 * len(near))
    angle, height = random.uniform(0.0, 2.0 * math.pi, len(which)), random.uniform(0.0, 6.0, len(which))
    x, y, radius = near[which].T
    bark = np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle), height + _ground(x, y, kind)])
    x, y = (place_m[axis] + random.uniform(-SEEN_M, SEEN_M, 1500) for axis in (0, 1))
    ground = np.column_stack([x, y, _ground(x, y, kind)])
    points = np.concatenate([bark, ground])
    return np.asarray(points + NOISE_M * random.standard_normal(points.shape))


def _ground(x: Array, y: Array, kind: str) -> Array:
    """Metres up; a plantation was levelled."""
    bumps = 0.25 * np.sin(0.4 * x) * np.cos(0.3 * y) + 0.1 * np.sin(1.1 * x + 0.7 * y)
    return np.zeros_like(x) if kind == "rows" else np.asarray(bumps)


def _odometry(way_m: Array, positions: Array, yaw: Array, drift: float, seed: int) -> np.ndarray:
    random, found = np.random.default_rng((seed, 4)), []
    place, turn, covariance = np.zeros(3), -float(yaw[0]), np.zeros((4, 4))
    for k, way in enumerate(way_m):
        if k:
            step = positions[k] - positions[k - 1]
            turn += drift * math.radians(DRIFT_DEG) * math.sqrt(STEP_M) * random.standard_normal()
            moved = about_vertical(turn) @ step + drift * DRIFT_M * math.sqrt(STEP_M) * random.standard_normal(3)
            carry = np.eye(4)
            carry[1, 0], carry[2, 0] = -moved[1], moved[0]
            grown = drift**2 * STEP_M * np.diag([math.radians(DRIFT_DEG) ** 2, *[DRIFT_M**2] * 3])
            place, covariance = place + moved, carry @ covariance @ carry.T + grown
        full = np.diag([0.0] * 3 + [1e-6] * 3)
        full[:3, :3], full[5, 5] = covariance[1:, 1:], covariance[0, 0] + 1e-6
        full[:3, 5] = full[5, :3] = covariance[0, 1:]
        zero, stamp = np.zeros(3), round(float(way) / SPEED_M_S * 1e9)
        pose = (place.copy(), about_vertical(turn + float(yaw[k])), zero, full, zero, zero)
        found.append(record_of(OdometryEstimate(stamp, *pose, float(way), False, np.zeros((0, 3)), 9, 9)))
    return np.concatenate(found)
