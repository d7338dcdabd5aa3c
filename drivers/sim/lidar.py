"""The laser of the simulated Mid-360: measured scan pattern, noise, range limits, no-returns in place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.sim.lidar_kernels import KNOT_NS, SLOT_NS, cast_slots
from drivers.sim.ray_kernels import RayGrid, trace_many
from drivers.sim.scene import Doubles
from drivers.sim.sources import PointBlock
from drivers.sim.trajectory import Trajectory

LEVER_M = (-0.011, -0.02329, 0.04412)
SWING_HZ = 9.93
BLOCK_KNOTS = 1000
MOST_SLOTS = 40_000
_SPARE_KNOTS = MOST_SLOTS * SLOT_NS // KNOT_NS + 2


@dataclass(frozen=True, slots=True)
class LidarConfig:
    """Range sigma is range_sigma_m + range_growth * distance: 1.2 cm at 10 m (data sheet: at most 2 cm).

    angle_sigma_deg: about each of two axes, so 0.14 degrees in all (data sheet: at most 0.15).
    """

    range_sigma_m: float = 0.008
    range_growth: float = 0.0004
    angle_sigma_deg: float = 0.10
    particles_per_slot: float = 3e-5
    glued_edges: float = 0.4


class Lidar:
    """A `LidarSource`. Not thread-safe. Cheapest in blocks of 2,000 slots (10 ms) and more."""

    def __init__(self, grid: RayGrid, trajectory: Trajectory, config: LidarConfig, seed: int) -> None:
        self._grid = grid
        self._trajectory = trajectory
        self._mirrors = _Mirrors(seed)
        self._noise = np.array(
            [
                config.range_sigma_m,
                config.range_growth,
                math.radians(config.angle_sigma_deg),
                config.particles_per_slot,
                config.glued_edges,
            ]
        )
        self._seed = np.uint64(seed * 2_654_435_761 + 97)
        self._lever = np.array(LEVER_M)
        self._block = -1
        self._knots: Doubles = np.empty((0, 14))

    def cast(self, t_ns: int, count: int) -> PointBlock:
        """`count` point slots from `t_ns` on; slot i of a call is of laser i % 4. `livox_frame`."""
        xyz = np.empty((count, 3), np.int32)
        reflectivity, tag = np.empty(count, np.uint8), np.empty(count, np.uint8)
        for first in range(0, count, MOST_SLOTS):
            part = slice(first, min(first + MOST_SLOTS, count))
            begin = t_ns + first * SLOT_NS
            cast_slots(
                self._grid,
                self._knots_from(begin),
                begin,
                part.stop - first,
                self._lever,
                self._noise,
                self._seed,
                xyz[part],
                reflectivity[part],
                tag[part],
            )
        return PointBlock(xyz, reflectivity, tag)

    def distances(self, origins: Doubles, directions: Doubles, reach_m: float = 100.0) -> Doubles:
        """Noise-free distance (n,) along rays (n, 3) in the world, infinite where nothing is within reach."""
        keys = np.arange(len(origins), dtype=np.uint64) * np.uint64(7919) + self._seed
        distance, kind = trace_many(self._grid, origins, directions, reach_m, keys)
        return np.where(kind > 0, distance, np.inf)

    def _knots_from(self, t_ns: int) -> Doubles:
        """Poses and mirror phases each millisecond, from the one at or before `t_ns`; a second of them is kept."""
        block, knot = divmod(t_ns // KNOT_NS, BLOCK_KNOTS)
        if block != self._block:
            t = (block * BLOCK_KNOTS + np.arange(BLOCK_KNOTS + _SPARE_KNOTS)) * KNOT_NS
            position, rotation = self._trajectory.poses(t)
            self._knots = np.ascontiguousarray(
                np.column_stack([position, rotation.reshape(-1, 9), self._mirrors.wander(t), self._mirrors.swing(t)])
            )
            self._block = block
        part: Doubles = self._knots[knot:]
        return part


class _Mirrors:
    """Phases of the two mirrors. Both wander, slowly and irregularly, so that no sweep repeats an earlier one.

    A phase that advances by the same amount each scan drags scan matchers in yaw (measured: up to 19 m).
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 61])
        self._hz = np.geomspace(0.031, 1.9, 8) * rng.uniform(0.8, 1.25, 8)
        self._phase = rng.uniform(0.0, 2.0 * np.pi, (2, 8))
        self._rad = np.radians(95.0) * (self._hz / self._hz[0]) ** -0.55
        self._start = rng.uniform(0.0, 2.0 * np.pi, 2)

    def wander(self, t_ns: npt.NDArray[np.int64]) -> Doubles:
        """Azimuth (rad) on top of the even turning of the fast mirror."""
        return np.asarray(self._start[0] + self._sum(t_ns, 0))

    def swing(self, t_ns: npt.NDArray[np.int64]) -> Doubles:
        """Phase (rad) of the slow up and down."""
        even = 2.0 * np.pi * SWING_HZ * 1e-9 * t_ns
        return np.asarray(self._start[1] + even + 0.4 * self._sum(t_ns, 1))

    def _sum(self, t_ns: npt.NDArray[np.int64], mirror: int) -> Doubles:
        angle = 2.0 * np.pi * 1e-9 * t_ns[:, None] * self._hz + self._phase[mirror]
        return np.asarray(np.sin(angle) @ self._rad)
