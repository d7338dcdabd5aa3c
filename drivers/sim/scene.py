"""The simulated forest as arrays: the one scene that laser and camera both look at.

World frame: ENU, metres, origin at the datum. Arrays are parallel: row i of each describes thing i.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """Heights at the corners of square cells, bilinear in between. height_m[row, column]: row is north, column east."""

    origin_m: tuple[float, float]
    cell_m: float
    height_m: Floats

    def height_at(self, xy_m: npt.ArrayLike) -> Doubles:
        """Ground height under points (n, 2). Beyond the grid, that of its edge."""
        points = np.atleast_2d(np.asarray(xy_m, dtype=np.float64))
        return self.sample(self.height_m, points)

    def sample(self, grid: Floats, points: Doubles) -> Doubles:
        """Bilinear value of any grid on the same corners at points (n, 2)."""
        rows, columns = grid.shape
        u = np.clip((points[:, 0] - self.origin_m[0]) / self.cell_m, 0.0, columns - 1.001)
        v = np.clip((points[:, 1] - self.origin_m[1]) / self.cell_m, 0.0, rows - 1.001)
        i, j = u.astype(np.int64), v.astype(np.int64)
        fu, fv = u - i, v - j
        south = grid[j, i] * (1.0 - fu) + grid[j, i + 1] * fu
        north = grid[j + 1, i] * (1.0 - fu) + grid[j + 1, i + 1] * fu
        return np.asarray(south * (1.0 - fv) + north * fv, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Trees:
    """The inventory. position_m: (n, 3) on the ground. clone: number of the Ailanthus clone, -1 for none."""

    position_m: Doubles
    species: npt.NDArray[np.uint8]
    dbh_m: Doubles
    height_m: Doubles
    crown_base_m: Doubles
    crown_radius_m: Doubles
    lean: Doubles
    clone: npt.NDArray[np.int32]
    taped: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.dbh_m)


@dataclass(frozen=True, slots=True, eq=False)
class Stems:
    """Leaning cone frusta without caps, row i being tree i; the radius is linear along the axis.

    base_m, top_m: (n, 3). tape_m: (n, 2) lowest and highest z of the retro-reflective band, NaN without one.
    """

    base_m: Floats
    top_m: Floats
    radius_base_m: Floats
    radius_top_m: Floats
    species: npt.NDArray[np.uint8]
    reflectivity: Floats
    tape_m: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Branches:
    """Cylinders without caps from start_m to end_m, (n, 3). tree: -1 for dead wood on the ground."""

    start_m: Floats
    end_m: Floats
    radius_m: Floats
    species: npt.NDArray[np.uint8]
    reflectivity: Floats
    tree: npt.NDArray[np.int32]


class Kind(IntEnum):
    """Where a clump of leaves belongs."""

    CROWN = 0
    UNDERSTOREY = 1
    GRASS = 2


@dataclass(frozen=True, slots=True, eq=False)
class Foliage:
    """Upright ellipsoids filled with leaves: semi_axes_m (n, 2) is horizontal, vertical.

    A beam survives a chord of length c with probability exp(-extinction_per_m * c).
    frond: (n, 3) unit vector, the main direction of the pinnate leaves; frond_m: their length, 0 for simple leaves.
    tree: -1 for understorey and grass.
    """

    centre_m: Floats
    semi_axes_m: Floats
    extinction_per_m: Floats
    reflectivity: Floats
    species: npt.NDArray[np.uint8]
    kind: npt.NDArray[np.uint8]
    tree: npt.NDArray[np.int32]
    frond: Floats
    frond_m: Floats

    def __len__(self) -> int:
        return len(self.extinction_per_m)


class Made(IntEnum):
    """What a box is part of."""

    BENCH = 0
    FENCE_POST = 1
    FENCE_RAIL = 2
    SIGN = 3


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Solid boxes: centre (n, 3), half_m (n, 3) half edges in the box frame, turned about z by yaw_rad, made `Made`."""

    centre_m: Floats
    half_m: Floats
    yaw_rad: Floats
    reflectivity: Floats
    made: npt.NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Trail:
    """Trodden path: centre line (n, 2), width. Bare soil, without grass or shrubs."""

    line_m: Doubles
    width_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything that stands in the forest. ground: diffuse reflectivity at the terrain's corners."""

    terrain: Terrain
    ground: Floats
    trees: Trees
    stems: Stems
    branches: Branches
    foliage: Foliage
    boxes: Boxes
    trail: Trail
