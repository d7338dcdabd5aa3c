"""What a GNSS antenna goes through: its true motion, and how much of the sky the crowns hide from it."""

from __future__ import annotations

import numpy as np

from drivers.sim.scene import Doubles, Floats, Terrain, Trees
from drivers.sim.trajectory import Trajectory

AROUND_M = 8


class Antenna:
    """Position and velocity (3,) in ENU, and canopy cover 0..1, at any walk time."""

    def __init__(
        self, trajectory: Trajectory, terrain: Terrain, covered: Floats, lever_m: tuple[float, float, float]
    ) -> None:
        self._trajectory = trajectory
        self._terrain = terrain
        self._covered = covered
        self._lever_m = lever_m

    def position(self, t_ns: int) -> Doubles:
        """(3,) metres."""
        return self._trajectory.position(t_ns, self._lever_m)

    def velocity(self, t_ns: int) -> Doubles:
        """(3,) m/s, swing of the lever included."""
        return self._trajectory.velocity(t_ns, self._lever_m)

    def canopy(self, t_ns: int) -> float:
        """0 open sky .. 1 closed."""
        return float(self._terrain.sample(self._covered, self.position(t_ns)[None, :2])[0])


def cover(trees: Trees, terrain: Terrain) -> Floats:
    """Share of the ground under crowns, 0..1, within `AROUND_M` (a square) of each corner of the terrain."""
    rows, columns = terrain.height_m.shape
    covered: Doubles = np.zeros((rows, columns))
    place = (trees.position_m[:, :2] - np.asarray(terrain.origin_m)) / terrain.cell_m
    for (u, v), radius in zip(place.tolist(), (trees.crown_radius_m / terrain.cell_m).tolist(), strict=True):
        i0, i1 = max(0, int(u - radius) + 1), min(columns, int(u + radius) + 1)
        j0, j1 = max(0, int(v - radius) + 1), min(rows, int(v + radius) + 1)
        inside = np.hypot(np.arange(i0, i1)[None, :] - u, np.arange(j0, j1)[:, None] - v) < radius
        covered[j0:j1, i0:i1] = np.maximum(covered[j0:j1, i0:i1], inside)
    return _boxed(covered, int(AROUND_M / terrain.cell_m)).astype(np.float32)


def _boxed(values: Doubles, reach: int) -> Doubles:
    """Mean over the square of 2 * reach + 1 cells, by sums of prefixes."""
    width = 2 * reach + 1
    padded = np.pad(values, ((reach + 1, reach), (reach + 1, reach)), mode="edge")
    sums = padded.cumsum(axis=0).cumsum(axis=1)
    total = sums[width:, width:] - sums[:-width, width:] - sums[width:, :-width] + sums[:-width, :-width]
    return np.asarray(total / width**2)
