"""The map in pieces of some metres of way, each with what was seen from there alone.

A place passed twice is there twice. The map's tiles keep one point a voxel whoever saw it first, which is right for a
map and useless for closing loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.estimates import OdometryEstimate

LENGTH_M = 10.0
"""Of way."""
STRIDE_M = 0.3
"""Of way between the sweeps that are taken."""
REACH_M = 35.0
"""From the sensor."""
VOXEL_M = 0.2
Points = npt.NDArray[np.float32]


class SubmapWriter:
    """Takes sweeps in order of time, writes a file a submap: 1.7 MB for ten metres."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._parts: list[Points] = []
        self._first = self._last = 0
        self._began_m = self._taken_m = -np.inf

    def add(self, estimate: OdometryEstimate, cloud: Points, sweep: int) -> None:
        """A sweep's points (n, 3 or more) in `odom`; sweep: its ordinal in the track."""
        way_m = estimate.travelled_m
        if len(cloud) and way_m - self._taken_m >= STRIDE_M:
            if way_m - self._began_m >= LENGTH_M:
                self.close()
                self._first, self._began_m = sweep, way_m
            self._taken_m, self._last = way_m, sweep
            near = np.linalg.norm(cloud[:, :3] - estimate.position_m.astype(np.float32), axis=1) < REACH_M
            self._parts.append(thin(cloud[near, :3]))

    def close(self) -> None:
        """Write what there is."""
        if self._parts:
            np.save(self._folder / f"{self._first:07d}_{self._last:07d}.npy", thin(np.concatenate(self._parts)))
            self._parts = []


@dataclass(frozen=True, slots=True)
class Submap:
    """Sweeps first to last of the track; the points are read when asked for."""

    first: int
    last: int
    path: Path

    @property
    def middle(self) -> int:
        """The sweep that it hangs on."""
        return (self.first + self.last) // 2

    def points(self) -> Points:
        """(n, 3) in `odom`."""
        found: Points = np.load(self.path)
        return found


def read_submaps(folder: Path) -> list[Submap]:
    """In order of time."""
    found = []
    for path in sorted(folder.glob("*.npy")):
        first, last = path.stem.split("_")
        found.append(Submap(int(first), int(last), path))
    return found


def thin(points: Points) -> Points:
    """The first point in each voxel."""
    cells = np.floor(points / VOXEL_M).astype(np.int64) + (1 << 20)
    keys = (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]
    return points[np.sort(np.unique(keys, return_index=True)[1])]
