"""A small plot as points with what a scanner adds to them, and maps of it."""

from dataclasses import dataclass

import laspy
import numpy as np

from pipeline.inventory.blocks import POINT
from pipeline.inventory.source import Part


@dataclass(frozen=True)
class Trunk:
    """dbh: at 1.3 m. lean: run over rise. taper: growth of the diameter a metre."""

    x: float
    y: float
    dbh: float
    lean: tuple = (0.0, 0.0)
    taper: float = -0.01
    height: float = 12.0

    def points(self, random, count, sensors, noise):
        """As beams see it: even across, from each of the sensors in turn; sideways and along the beam it is noisy, and
        where a beam is partly beside the trunk, a share of the returns is not in the map."""
        h = random.uniform(0.2, 7.0, count)
        axis = np.array([self.x, self.y]) + np.outer(h, self.lean)
        radius = 0.5 * (self.dbh + self.taper * (h - 1.3))
        stood = sensors[random.integers(len(sensors), size=count)]
        beam = axis - stood
        away = np.linalg.norm(beam, axis=1, keepdims=True)
        beam /= away
        across = np.column_stack([-beam[:, 1], beam[:, 0]])
        y = random.uniform(-1, 1, count) * radius
        spoilt = (radius - np.abs(y) < RIM[0] + RIM[1] * away[:, 0]) & (random.random(count) < RIM[2])
        depth = -np.sqrt(radius**2 - y**2)
        y = y + noise[0] * away[:, 0] * random.standard_normal(count)
        depth = depth + noise[1] * random.standard_normal(count)
        return np.column_stack([axis + across * y[:, None] + beam * depth[:, None], h])[~spoilt], stood[~spoilt]


def slope(xy):
    return 0.25 * xy[:, 0] - 0.1 * xy[:, 1]


RIM = (0.003, 0.0026, 0.4)
"""Width at no range, its growth a metre, share lost: of a scanner whose glued points are left out."""
NOISE = (0.0018, 0.011)
"""Radians across the beam, metres along it: of the scanner that the configuration assumes, without a blur."""


@dataclass
class PlotMap:
    """A map in memory, on a slope, with brush."""

    trunks: list
    seed: int = 1
    noise: tuple = NOISE
    told: bool = True
    each: int = 2500
    origin: tuple = (450_000.0, 5_200_000.0, 300.0)
    voxel_m: float = 0.0
    crs = None
    name = "plot"

    def __post_init__(self):
        random = np.random.default_rng(self.seed)
        sensors = np.array([[x, 0.0] for x in np.arange(-12.0, 12.1, 1.0)])
        xy = random.uniform(-14, 14, (40_000, 2))
        ground = np.column_stack([xy, random.normal(0, 0.02, len(xy))])
        middles = random.uniform(-13, 13, (25, 2))
        brush = np.concatenate([random.normal([*m, 0.6], [0.3, 0.3, 0.35], (250, 3)) for m in middles])
        parts = [(ground, np.zeros((len(ground), 2))), (brush[brush[:, 2] > 0], np.zeros(((brush[:, 2] > 0).sum(), 2)))]
        for trunk in self.trunks:
            parts.append(trunk.points(random, self.each, sensors, self.noise))
            crown = random.normal([trunk.x, trunk.y, trunk.height - 2], [0.8, 0.8, 0.7], (2000, 3))
            parts.append((crown, np.zeros((2000, 2))))
        points = np.concatenate([p for p, _ in parts])
        points[:, 2] += slope(points[:, :2])
        self.shift = np.array([20.0, 20.0, 20.0])
        self.xyz = (points + self.shift).astype(np.float32)
        self.sensor = np.concatenate([s for _, s in parts]) + 20.0
        self.origin_m = np.array(self.origin)
        self.bounds_m = np.array([self.xyz[:, :2].min(0), self.xyz[:, :2].max(0)], np.float64)
        self.count = len(self.xyz)

    def placed(self, xyz_m):
        return xyz_m + self.origin_m

    def parts(self):
        sensor = self.sensor.astype(np.float32) if self.told else None
        yield Part(self.xyz, np.zeros(len(self.xyz), np.bool_), sensor)

    def save(self, path, crs=None):
        header = laspy.LasHeader(version="1.4", point_format=6)
        header.scales = np.full(3, 0.001)
        header.offsets = self.origin_m
        if crs is not None:
            header.add_crs(crs)
        las = laspy.LasData(header)
        las.x, las.y, las.z = (self.xyz.astype(np.float64) + self.origin_m).T
        las.write(path)
        return path


def block(trunks, seed=1, noise=NOISE, count=3000):
    """Points of trunks alone, (n,) of `POINT`, seen from y = 0."""
    random = np.random.default_rng(seed)
    sensors = np.array([[x, 0.0] for x in np.arange(-12.0, 12.1, 1.0)])
    parts = [trunk.points(random, count, sensors, noise) for trunk in trunks]
    xyz = np.concatenate([p for p, _ in parts])
    out = np.zeros(len(xyz), POINT)
    out["xyz"], out["height"] = xyz, xyz[:, 2]
    out["sensor"] = np.concatenate([s for _, s in parts])
    return out
