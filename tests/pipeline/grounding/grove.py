"""A small grove as points, a walk past it, and boxes as a detector would draw them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.camera import CameraModel
from pipeline.detections import FrameDetections
from pipeline.grounding.views import CameraView

CAMERA = CameraModel(848, 480, (432.0, 432.0), (423.5, 239.5))
SECOND = 1_000_000_000


@dataclass
class Trunk:
    x: float
    y: float
    target: bool = False
    radius: float = 0.12
    crown_from: float = 3.0
    height: float = 8.0
    crown_radius: float = 1.5

    def points(self, random):
        turn = random.uniform(0, 2 * np.pi, 1500)
        stem = np.column_stack([self.x + self.radius * np.cos(turn), self.y + self.radius * np.sin(turn),
                                random.uniform(0, self.crown_from + 1.0, 1500)])  # fmt: skip
        leaf = random.normal(size=(2500, 3))
        leaf *= random.random(2500)[:, None] ** (1 / 3) / np.linalg.norm(leaf, axis=1, keepdims=True)
        half = (self.height - self.crown_from) / 2
        crown = leaf * [self.crown_radius, self.crown_radius, half] + [self.x, self.y, self.crown_from + half]
        return np.concatenate([stem, crown])

    def outline(self):
        """Points on stem and crown, (n, 3)."""
        turn = np.linspace(0, 2 * np.pi, 24)
        half = (self.height - self.crown_from) / 2
        rings = [(self.radius, z) for z in np.arange(0.0, self.crown_from, 0.4)]
        rings += [(self.crown_radius * np.sqrt(1 - s * s), self.crown_from + half * (1 + s))
                  for s in np.linspace(-0.98, 0.98, 9)]  # fmt: skip
        return np.concatenate(
            [np.column_stack([self.x + r * np.cos(turn), self.y + r * np.sin(turn), np.full(24, z)]) for r, z in rings]
        )

    def hides(self, eye, points):
        """(n,) whether stem or crown lies between the eye and points (n, 3)."""
        half = (self.height - self.crown_from) / 2
        scale = np.array([self.crown_radius, self.crown_radius, half])
        away, start = (points - eye) / scale, (eye - [self.x, self.y, self.crown_from + half]) / scale
        crown = _crosses(away, start)
        flat, begin = (points - eye)[:, :2] / self.radius, (eye[:2] - [self.x, self.y]) / self.radius
        t = np.clip(-(flat @ begin) / (flat**2).sum(axis=1), 0, 0.98)
        near = ((begin + t[:, None] * flat) ** 2).sum(axis=1) < 1.0
        return crown | (near & (eye[2] + t * (points[:, 2] - eye[2]) < self.crown_from))


def _crosses(away, start):
    """(n,) whether start + t away, 0 < t < 0.95, enters the unit ball."""
    t = np.clip(-(away @ start) / (away**2).sum(axis=1), 0, 0.95)
    return ((start + t[:, None] * away) ** 2).sum(axis=1) < 1.0


@dataclass
class Grove:
    """trunks on level ground. recall: share of views in which a target is boxed; lies: boxes a view on nothing."""

    trunks: list[Trunk]
    seed: int = 1
    recall: float = 1.0
    lies: float = 0.0
    jitter: float = 0.03
    points: np.ndarray = field(init=False)

    def __post_init__(self):
        random = np.random.default_rng(self.seed)
        flat = random.uniform([-30, -30, -0.02], [60, 30, 0.02], (60_000, 3))
        self.points = np.concatenate([flat, *(trunk.points(random) for trunk in self.trunks)])

    def around(self, place_m, radius_m):
        return self.points[np.linalg.norm(self.points - place_m, axis=1) < radius_m]

    def walk(self, start=(-6.0, 0.0), end=(14.0, 0.0), heading=0.6, every_m=0.6):
        """Views along a line, looking aside, and what the detector says of each."""
        random = np.random.default_rng((self.seed, 9))
        start, end = np.array(start), np.array(end)
        way = np.linalg.norm(end - start)
        for k, share in enumerate(np.arange(0.0, 1.0, every_m / way)):
            view = looking(*(start + share * (end - start)), heading, k * SECOND // 2)
            yield view, self.detections(view, random)

    def box(self, trunk, view):
        """Around what is unhidden of a trunk, (4,); None for less than a third of it."""
        points = trunk.outline()
        away = (points - view.position_m) @ view.rotation
        with np.errstate(all="ignore"):
            u = CAMERA.focal_px[0] * away[:, 0] / away[:, 2] + CAMERA.centre_px[0]
            v = CAMERA.focal_px[1] * away[:, 1] / away[:, 2] + CAMERA.centre_px[1]
        shown = (away[:, 2] > 0.3) & (u > 0) & (u < 847) & (v > 0) & (v < 479)
        for other in self.trunks:
            if other is not trunk:
                shown &= ~other.hides(view.position_m, points)
        if shown.mean() < 0.33:
            return None
        return np.array([u[shown].min(), v[shown].min(), u[shown].max(), v[shown].max()])

    def detections(self, view, random):
        boxes, sure = [], []
        for trunk in self.trunks:
            box = self.box(trunk, view)
            range_m = np.hypot(trunk.x - view.position_m[0], trunk.y - view.position_m[1])
            if trunk.target and box is not None and range_m < 14.0 and random.random() < self.recall:
                side = np.tile(box[2:] - box[:2], 2)
                boxes.append(box + self.jitter * side * random.standard_normal(4))
                sure.append(random.uniform(0.5, 0.95))
        for _ in range(random.poisson(self.lies)):
            corner = random.uniform([0, 0], [700, 300])
            boxes.append(np.concatenate([corner, corner + random.uniform(60, 150, 2)]))
            sure.append(random.uniform(0.35, 0.7))
        order = np.argsort(sure)[::-1].astype(int)
        stack = np.array(boxes).reshape(-1, 4)[order]
        kinds = np.zeros(len(stack), np.int64)
        return FrameDetections(view.stamp_ns, 848, 480, stack, np.array(sure)[order], kinds, ("tree-of-heaven",))


def looking(x, y, heading, stamp_ns=0, height=1.3):
    """A level camera; heading 0 looks along x."""
    ahead, left = np.array([np.cos(heading), np.sin(heading), 0]), np.array([-np.sin(heading), np.cos(heading), 0])
    rotation = np.column_stack([-left, [0.0, 0.0, -1.0], ahead])
    return CameraView(stamp_ns, CAMERA, rotation, np.array([x, y, height]), 0.002, 0.02, 0.01, 0.02)
