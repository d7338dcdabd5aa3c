"""The map while it grows: square tiles in `odom`, points thinned to one a voxel, spilled to disk beyond a budget."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

POINT = np.dtype([("xyz", "<f4", 3), ("sweep", "<u4"), ("intensity", "u1")])
"""xyz: `odom`, metres. sweep: ordinal in the track, which tells time and pose."""
RETRO = 150
"""Livox: from this reflectivity on it is a retro-reflector; such points mark measured trees, and are never thinned
away by others."""
Tile = tuple[int, int]
_SPAN = 1 << 20
_FARTHEST_M = 50_000.0
"""From the start; single precision and the keys of voxels end about here. NaN is farther than anything."""


class TileStore:
    """Takes sweeps, keeps at most `budget_bytes` of points in memory. Not thread-safe."""

    def __init__(self, folder: Path, tile_m: float, voxel_m: float, budget_bytes: int = 96 << 20) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._tile_m = tile_m
        self._voxel_m = voxel_m
        self._budget = budget_bytes
        self._open: dict[Tile, list[npt.NDArray[np.void]]] = {}
        self._touched: dict[Tile, int] = {}
        self._bytes = 0
        self._lean: dict[Tile, int] = {}
        """Bytes of each file when it was thinned last."""

    def add(self, cloud: npt.NDArray[np.float32], sweep: int) -> None:
        """A sweep's points (n, 4): x, y, z in `odom`, intensity 0..255."""
        cloud = cloud[(np.abs(cloud[:, :3]) < _FARTHEST_M).all(axis=1)]
        points = np.empty(len(cloud), POINT)
        points["xyz"] = cloud[:, :3]
        points["sweep"] = sweep
        points["intensity"] = np.clip(cloud[:, 3], 0, 255)
        cells = np.floor(cloud[:, :2] / self._tile_m).astype(np.int64)
        keys = (cells[:, 0] + _SPAN) * (2 * _SPAN) + cells[:, 1] + _SPAN
        order = np.argsort(keys, kind="stable")
        found, starts = np.unique(keys[order], return_index=True)
        for key, part in zip(found.tolist(), np.split(points[order], starts[1:]), strict=False):
            tile = (key // (2 * _SPAN) - _SPAN, key % (2 * _SPAN) - _SPAN)
            self._open.setdefault(tile, []).append(part)
            self._touched[tile] = sweep
        self._bytes += points.nbytes
        if self._bytes > self._budget:
            self._relieve()

    def close(self) -> None:
        """Everything to the disk."""
        for tile in list(self._open):
            self._spill(tile)

    def _relieve(self) -> None:
        """Thin all; if that does not halve the memory, write out the tiles left behind longest ago."""
        for tile, parts in self._open.items():
            self._open[tile] = [thinned(np.concatenate(parts), self._voxel_m)]
        self._bytes = sum(part.nbytes for parts in self._open.values() for part in parts)
        for tile in sorted(self._open, key=lambda tile: self._touched[tile]):
            if self._bytes <= self._budget // 2:
                return
            self._bytes -= self._open[tile][0].nbytes
            self._spill(tile)

    def _spill(self, tile: Tile) -> None:
        points, path = thinned(np.concatenate(self._open.pop(tile)), self._voxel_m), _path(self._folder, tile)
        with path.open("ab") as file:
            file.write(points.tobytes())
            size = file.tell()
        if size > 2 * self._lean.setdefault(tile, size):  # ways that come by again and again fill no disk
            points = thinned(np.fromfile(path, POINT), self._voxel_m)
            path.write_bytes(points.tobytes())
            self._lean[tile] = points.nbytes


def tiles(folder: Path) -> list[Tile]:
    """Those on the disk, in order."""
    return sorted((int(x), int(y)) for x, y in (path.stem.split("_") for path in folder.glob("*.tile")))


def read_tile(folder: Path, tile: Tile, voxel_m: float) -> npt.NDArray[np.void]:
    """(n,) of POINT, one a voxel, retro-reflectors kept, in order of time."""
    points = thinned(np.fromfile(_path(folder, tile), POINT), voxel_m)
    return points[np.argsort(points["sweep"], kind="stable")]


def thinned(points: npt.NDArray[np.void], voxel_m: float) -> npt.NDArray[np.void]:
    """The first point in each voxel, and the first retro-reflector in each."""
    keys = np.zeros(len(points), np.int64)
    for axis in range(3):  # one at a time: a tile has millions of points
        keys <<= 21
        keys |= np.floor(points["xyz"][:, axis] / voxel_m).astype(np.int64) + _SPAN
    keys = (keys << 1) | (points["intensity"] >= RETRO)
    kept: npt.NDArray[np.void] = points[np.sort(np.unique(keys, return_index=True)[1])]
    return kept


def _path(folder: Path, tile: Tile) -> Path:
    return folder / f"{tile[0]}_{tile[1]}.tile"
