"""The semantic map: how probable it is that what is seen at a place belongs to a target tree.

Positive where a box points, negative where the camera looked and there was no box; of both, only what stands unhidden
and within range. A place that no view has shown has no evidence: that is not the same as none found.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.grounding import evidence_kernels as kernels

Array = npt.NDArray[np.float64]
LEAST_PLACES = 1 << 16
FULLEST = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class Heat:
    """Of points (n,): log_odds float32, seen and hits uint16; seen is 0 where no view showed the place."""

    log_odds: npt.NDArray[np.float32]
    seen: npt.NDArray[np.uint16]
    hits: npt.NDArray[np.uint16]

    @property
    def probability(self) -> npt.NDArray[np.float32]:
        """(n,), one half where nothing is known."""
        return np.asarray(1.0 / (1.0 + np.exp(-self.log_odds)), np.float32)


class Evidence:
    """Grows with what was seen: 20 bytes a voxel and as much room again. Not thread-safe."""

    def __init__(self, voxel_m: float, most_log_odds: float) -> None:
        self.voxel_m = voxel_m
        self._most = most_log_odds
        self._keys = np.full(LEAST_PLACES, kernels.EMPTY, np.int64)
        self._voxels = np.zeros(LEAST_PLACES, kernels.VOXEL)
        self._used = 0
        self._view = 0

    def __len__(self) -> int:
        return self._used

    def add(self, points_m: Array, change: npt.NDArray[np.float32]) -> None:
        """One view: log-odds for its points (n, 3); NaN for those it says nothing of."""
        while (self._used + len(points_m)) > FULLEST * len(self._keys):
            self._grow()
        self._view += 1
        args = (self._keys, self._voxels, points_m, change, 1.0 / self.voxel_m, self._view, self._most)
        self._used += kernels.add(*args)

    def at(self, points_m: Array) -> Heat:
        """What is known of points (n, 3)."""
        slots = np.empty(len(points_m), np.int64)
        kernels.find(self._keys, np.ascontiguousarray(points_m, np.float64), 1.0 / self.voxel_m, slots)
        found = self._voxels[np.maximum(slots, 0)]
        known = slots >= 0
        return Heat(
            np.where(known, found["log_odds"], np.float32(0.0)).astype(np.float32),
            np.where(known, found["seen"], 0).astype(np.uint16),
            np.where(known, found["hits"], 0).astype(np.uint16),
        )

    def voxels(self) -> tuple[Array, npt.NDArray[np.float32], npt.NDArray[np.int32]]:
        """Middles (n, 3) of those that are known, log-odds (n,), and the last view that spoke of each (n,), from 1."""
        used = self._keys != kernels.EMPTY
        keys, voxels = self._keys[used], self._voxels[used]
        axes = [((keys >> shift) & kernels.FIELD) - kernels.HALF for shift in (42, 21, 0)]
        return (np.column_stack(axes) + 0.5) * self.voxel_m, voxels["log_odds"], voxels["last"]

    def save(self, path: Path) -> None:
        """As a numpy archive."""
        used = self._keys != kernels.EMPTY
        np.savez(path, voxel_m=self.voxel_m, most=self._most, keys=self._keys[used], voxels=self._voxels[used])

    @classmethod
    def load(cls, path: Path) -> Evidence:
        """What `save` wrote."""
        with np.load(path) as found:
            evidence = cls(float(found["voxel_m"]), float(found["most"]))
            keys, voxels = found["keys"], found["voxels"]
        while len(keys) > FULLEST * len(evidence._keys):
            evidence._grow()
        kernels.rehash(keys, voxels, evidence._keys, evidence._voxels)
        evidence._used, evidence._view = len(keys), int(voxels["last"].max(initial=0))
        return evidence

    def _grow(self) -> None:
        keys = np.full(2 * len(self._keys), kernels.EMPTY, np.int64)
        voxels = np.zeros(len(keys), kernels.VOXEL)
        kernels.rehash(self._keys, self._voxels, keys, voxels)
        self._keys, self._voxels = keys, voxels
