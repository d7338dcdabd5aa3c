"""Points of one or two maps on the disk in square cells, so that any small place can be read with what is around it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.inventory.source import Part

Doubles = npt.NDArray[np.float64]
POINT = np.dtype(
    [("xyz", "<f4", 3), ("time_s", "<f8"), ("source", "<u2"), ("reflector", "?"), ("reference", "?"), ("chosen", "?")]
)
"""xyz: from the map's origin. time_s: from the first point of the map, NaN where there is none. chosen: looked at; of
the others only what lies around these counts."""
CELL_M = 5.0
_BUFFER = 64 << 20
Cell = tuple[int, int]


class MapStore:
    """Takes parts, and gives back what is in and around a cell or near a place."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._held: defaultdict[Cell, list[npt.NDArray[np.void]]] = defaultdict(list)
        self._bytes = self._seen = 0
        self._first_s = np.nan

    def add(self, part: Part, every: int, shift_m: Doubles | None = None) -> None:
        """every: one point of so many is chosen; 0: this is the reference. shift_m: (3,) its origin from the map's."""
        points = np.zeros(len(part.xyz_m), POINT)
        points["xyz"] = part.xyz_m if shift_m is None else part.xyz_m + shift_m
        points["reflector"], points["reference"] = part.reflector, every == 0
        points["time_s"] = np.nan if part.time_s is None else part.time_s - self._since(part.time_s)
        points["source"] = 0 if part.source is None else part.source
        if every:
            points["chosen"][-self._seen % every :: every] = True
            self._seen += len(points)
        self._file(points[np.isfinite(points["xyz"]).all(axis=1)])

    def _since(self, time_s: Doubles) -> float:
        if np.isnan(self._first_s) and len(time_s):
            self._first_s = float(time_s[0])
        return self._first_s

    def _file(self, points: npt.NDArray[np.void]) -> None:
        cells, which = np.unique(_cells(points["xyz"]), axis=0, return_inverse=True)
        order = np.argsort(which.ravel(), kind="stable")
        ends = np.cumsum(np.bincount(which.ravel(), minlength=len(cells)))[:-1]
        for (i, j), some in zip(cells.tolist(), np.split(points[order], ends), strict=False):
            self._held[i, j].append(some)
            self._bytes += some.nbytes
        if self._bytes > _BUFFER:
            self.flush()

    def flush(self) -> None:
        """Everything to the disk."""
        for cell, parts in self._held.items():
            with self._path(cell).open("ab") as file:
                for part in parts:
                    file.write(part.tobytes())
        self._held.clear()
        self._bytes = 0

    def cells(self, margin_m: float) -> Iterator[tuple[float, npt.NDArray[np.void]]]:
        """The share that is done, and the points of each cell and of a margin around it, of which none is chosen."""
        paths = sorted(self._folder.glob("*.cell"))
        for number, path in enumerate(paths):
            i, j = (int(word) for word in path.stem.split("_"))
            low = np.array([i, j]) * CELL_M
            points = self._box(low - margin_m, low + CELL_M + margin_m)
            points["chosen"] &= (_cells(points["xyz"]) == (i, j)).all(axis=1)
            yield number / len(paths), points

    def near(self, xy_m: Doubles, reach_m: float) -> npt.NDArray[np.void]:
        """Of the map itself, within a distance of (2,) in plan."""
        points = self._box(xy_m - reach_m, xy_m + reach_m)
        away = np.hypot(*(points["xyz"][:, :2] - xy_m).T)
        kept: npt.NDArray[np.void] = points[(away <= reach_m) & ~points["reference"]]
        return kept

    def _box(self, low: Doubles, high: Doubles) -> npt.NDArray[np.void]:
        first, last = np.floor(low / CELL_M).astype(int), np.floor(high / CELL_M).astype(int)
        parts = []
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                if (path := self._path((i, j))).exists():
                    points = np.fromfile(path, POINT)
                    xy = points["xyz"][:, :2]
                    parts.append(points[((xy >= low) & (xy <= high)).all(axis=1)])
        return np.concatenate(parts) if parts else np.empty(0, POINT)

    def _path(self, cell: Cell) -> Path:
        return self._folder / f"{cell[0]}_{cell[1]}.cell"


def _cells(xyz: npt.NDArray[np.float32]) -> npt.NDArray[np.int64]:
    return np.asarray(np.floor(xyz[:, :2].astype(np.float64) / CELL_M).astype(np.int64))
