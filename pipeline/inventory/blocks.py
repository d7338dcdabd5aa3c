"""The part of a map where stems are, on the disk in square blocks with a margin, so that one is in memory at a time."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.inventory.source import Part

Floats = npt.NDArray[np.float32]
POINT = np.dtype([("xyz", "<f4", 3), ("height", "<f4"), ("sensor", "<f4", 2), ("reflector", "?")])
"""xyz: from the map's origin. sensor: x, y, NaN where the map does not say."""
Block = tuple[int, int]
LOWEST_M, MARGIN_M = 0.3, 1.5
MOST_POINTS, LEAST_SIDE_M = 6_000_000, 4.0
"""Blocks that could hold more are made smaller, down to that side: they are in memory as a whole."""
_BUFFER = 64 << 20


class BlockStore:
    """Takes parts with their heights; keeps what lies between `LOWEST_M` and a greatest height."""

    def __init__(self, folder: Path, side_m: float, highest_m: float) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._side_m, self._highest_m = folder, side_m, highest_m
        self._held: defaultdict[Block, list[npt.NDArray[np.void]]] = defaultdict(list)
        self._bytes = 0
        self.kept = 0

    def add(self, part: Part, height_m: Floats) -> None:
        """Points on the rim of a block are given to its neighbours too."""
        with np.errstate(invalid="ignore"):
            kept = np.flatnonzero((height_m > LOWEST_M) & (height_m < self._highest_m))
        self.kept += len(kept)
        points = np.empty(len(kept), POINT)
        points["xyz"], points["height"] = part.xyz_m[kept], height_m[kept]
        points["sensor"] = np.nan if part.sensor_m is None else part.sensor_m[kept]
        points["reflector"] = part.reflector[kept]
        cells = np.floor(points["xyz"][:, :2] / self._side_m).astype(np.int64)
        beyond = points["xyz"][:, :2] - cells * self._side_m  # the lower rim of their block
        near = {-1: beyond < MARGIN_M, 0: np.ones_like(beyond, np.bool_), 1: beyond >= self._side_m - MARGIN_M}
        for di in (-1, 0, 1):
            for dj in (-1, 0, 1):
                mine = near[di][:, 0] & near[dj][:, 1]
                self._give(points[mine], cells[mine] + (di, dj))
        if self._bytes > _BUFFER:
            self.flush()

    def _give(self, points: npt.NDArray[np.void], blocks: npt.NDArray[np.int64]) -> None:
        """blocks: (n, 2), whose each point is."""
        if not len(points):
            return
        first = blocks.min(axis=0)
        rows, columns = (blocks.max(axis=0) - first + 1).tolist()
        flat = (blocks[:, 0] - first[0]) * columns + blocks[:, 1] - first[1]
        flat = flat.astype(
            np.min_scalar_type(rows * columns)
        )  # small numbers are sorted by their digits: 50 times as fast
        order, count = np.argsort(flat, kind="stable"), np.bincount(flat)
        for k, some in zip(
            np.flatnonzero(count).tolist(), np.split(order, np.cumsum(count[count > 0])[:-1]), strict=True
        ):
            mine = points[some]
            self._held[int(first[0]) + k // columns, int(first[1]) + k % columns].append(mine)
            self._bytes += mine.nbytes

    def flush(self) -> None:
        """Everything to the disk."""
        for (i, j), parts in self._held.items():
            with (self._folder / f"{i}_{j}.block").open("ab") as file:
                for part in parts:
                    file.write(part.tobytes())
        self._held.clear()
        self._bytes = 0

    def blocks(self) -> list[Block]:
        """Those on the disk, in order."""
        return sorted((int(i), int(j)) for i, j in (path.stem.split("_") for path in self._folder.glob("*.block")))

    def read(self, block: Block) -> npt.NDArray[np.void]:
        """(n,) of POINT, margin included."""
        return np.fromfile(self._folder / f"{block[0]}_{block[1]}.block", POINT)

    def owns(self, block: Block, x_m: float, y_m: float) -> bool:
        """Whether a place is in the block itself, not in its margin."""
        return (int(np.floor(x_m / self._side_m)), int(np.floor(y_m / self._side_m))) == block
