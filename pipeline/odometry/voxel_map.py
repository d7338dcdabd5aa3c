"""What was seen, as Gaussians in voxels, within a fixed amount of memory."""

from __future__ import annotations

import numpy as np

from pipeline.odometry import map_kernels as kernels
from pipeline.odometry.config import MapConfig
from pipeline.odometry.so3 import Doubles

STALE_SCANS = 100
SWEEPS = 64
"""The whole table is looked through once in so many scans."""
TIGHT = 0.85
LEAST_REACH_M = 15.0


class VoxelMap:
    """Insertion and look-up cost the same however long the ride. Not thread-safe."""

    def __init__(self, config: MapConfig) -> None:
        self._config = config
        self._sizes = np.array(config.sizes_m)
        self._scan = 0
        self._reach_m = config.reach_m
        self._grid = _empty(config.voxels_most)

    def __len__(self) -> int:
        return int(self._grid.numbers[kernels.USED])

    @property
    def refused(self) -> int:
        """Voxels that found no room. The reach shrinks long before."""
        return int(self._grid.numbers[kernels.REFUSED])

    @property
    def nbytes(self) -> int:
        """All memory of the map; fixed at construction."""
        return sum(array.nbytes for array in self._grid)

    @property
    def arrays(self) -> kernels.MapArrays:
        """For the matching kernels."""
        return self._grid

    @property
    def sizes(self) -> Doubles:
        """Voxel size of each level in m, fine to coarse."""
        return self._sizes

    def places(self) -> Doubles:
        """Low corners (k, 3) of all fine voxels, in m; slow, for once in a while."""
        keys = self._grid.slots[:, 0]
        keys = keys[(keys != kernels.EMPTY) & (keys >> (3 * kernels.BITS) < kernels.SIDES)]
        fields = [(keys >> (k * kernels.BITS)) & kernels.FIELD for k in (2, 1, 0)]
        return np.asarray(self._sizes[0] * (np.column_stack(fields) - kernels.HALF))

    def insert(self, clusters: Doubles, rotation: Doubles, position: Doubles) -> None:
        """Take in the clusters of a scan, seen from a pose, and forget a little of what is far."""
        self._scan += 1
        kernels.insert(
            self._grid,
            clusters,
            rotation,
            position,
            self._sizes,
            self._config.sides,
            self._config.frozen_points,
            self._scan,
        )
        full = len(self) / self._config.voxels_most
        grow = 0.98 if full > TIGHT else 1.01
        self._reach_m = min(max(self._reach_m * grow, LEAST_REACH_M), self._config.reach_m)
        places = len(self._grid.slots) // SWEEPS
        kernels.sweep(self._grid, position, self._sizes, self._reach_m, self._scan, STALE_SCANS, places)


def _empty(most: int) -> kernels.MapArrays:
    places = 1 << (2 * most - 1).bit_length()
    return kernels.MapArrays(
        slots=np.full((places, 2), kernels.EMPTY, np.int64),
        voxels=np.zeros((most, kernels.VOXEL), np.float32),
        free=np.arange(most, dtype=np.int32)[::-1].copy(),
        numbers=np.array([0, 0, 0, most, 0], np.int64),
    )
