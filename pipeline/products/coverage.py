"""What was looked at, how often, and what it looked like: the grid that gives absence a meaning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.special import expit

Array = npt.NDArray[np.float64]
BLOCK = 64
"""Cells along the edge of a block."""
CELL = np.dtype([("views", "<u4"), ("log_odds", "<f4"), ("sigma_m", "<f4")])
_NEVER = np.array((0, -np.inf, np.inf), CELL)
_SPAN = 1 << 30
Block = tuple[int, int]
Ordinals = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """Cells under n places. views: (n,) images that showed the cell, 0: it was not searched.

    probability: (n,) of the tree that is looked for, 0 where it was searched and nothing speaks for it; sigma_m: (n,)
    horizontal, of the view that knew it best. NaN where it was not searched.
    """

    views: npt.NDArray[np.uint32]
    probability: npt.NDArray[np.float32]
    sigma_m: npt.NDArray[np.float32]

    def reshaped(self, *shape: int) -> Sampled:
        """The same as a picture."""
        return Sampled(self.views.reshape(shape), self.probability.reshape(shape), self.sigma_m.reshape(shape))


class CoverageGrid:
    """Square cells in the frame of the trees, in blocks that exist where something was seen. Not thread-safe."""

    def __init__(self, cell_m: float = 0.5) -> None:
        self.cell_m = cell_m
        self._blocks: dict[Block, npt.NDArray[np.void]] = {}

    def see(self, points_m: Array, sigma_m: float | Array) -> None:
        """One image: each cell under any of its unhidden points (n, 2 or 3) counts once.

        sigma_m: horizontal, of each point (n,) as this image places it.
        """
        values = np.broadcast_to(np.asarray(sigma_m, np.float32), len(points_m))
        for block, rows, columns, best in self._grouped(points_m, values, np.minimum):
            block["views"][rows, columns] += 1
            block["sigma_m"][rows, columns] = np.minimum(block["sigma_m"][rows, columns], best)

    def weigh(self, points_m: Array, log_odds: Array) -> None:
        """Evidence (n,) of points of the map (n, 2 or 3), of all images; a cell keeps the largest over its height."""
        for block, rows, columns, most in self._grouped(points_m, np.asarray(log_odds, np.float32), np.maximum):
            block["log_odds"][rows, columns] = np.maximum(block["log_odds"][rows, columns], most)

    def sample(self, places_m: Array) -> Sampled:
        """The cells that places (n, 2) lie in."""
        found = np.full(len(places_m), _NEVER)
        cells = self._cells(places_m)
        for block, part in _by_block(cells):
            if block in self._blocks:
                column, row = (cells[part] % BLOCK).T
                found[part] = self._blocks[block][row, column]
        return _sampled(found)

    def blocks(self) -> Iterator[tuple[tuple[float, float], Sampled]]:
        """Lower left corner in metres, and cells (BLOCK, BLOCK) from there north and east, of each block."""
        edge_m = BLOCK * self.cell_m
        for (x, y), block in self._blocks.items():
            yield (x * edge_m, y * edge_m), _sampled(block)

    def bounds_m(self) -> tuple[float, float, float, float] | None:
        """West, south, east, north of what was searched; None for nothing."""
        edges = []
        for (west, south), cells in self.blocks():
            rows, columns = np.nonzero(cells.views)
            if len(rows):
                edges.append((west, south) + np.array([columns.min(), rows.min()]) * self.cell_m)
                edges.append((west, south) + np.array([columns.max() + 1, rows.max() + 1]) * self.cell_m)
        if not edges:
            return None
        (west, south), (east, north) = np.min(edges, axis=0).tolist(), np.max(edges, axis=0).tolist()
        return west, south, east, north

    @property
    def area_m2(self) -> float:
        """Searched."""
        return sum(int(np.count_nonzero(block["views"])) for block in self._blocks.values()) * self.cell_m**2

    def save(self, path: Path) -> None:
        """As a numpy archive."""
        cells = np.array(list(self._blocks.values()), CELL).reshape(-1, BLOCK, BLOCK)
        with path.open("wb") as file:
            np.savez_compressed(file, cell_m=self.cell_m, blocks=np.array(list(self._blocks), np.int64), cells=cells)

    @classmethod
    def load(cls, path: Path) -> CoverageGrid:
        """What `save` wrote."""
        with np.load(path) as found:
            grid = cls(float(found["cell_m"]))
            blocks = [(x, y) for x, y in found["blocks"].reshape(-1, 2).tolist()]
            grid._blocks = dict(zip(blocks, found["cells"], strict=True))
        return grid

    def _cells(self, points_m: Array) -> npt.NDArray[np.int64]:
        return np.floor(points_m[:, :2] / self.cell_m).astype(np.int64)

    def _grouped(
        self, points_m: Array, values: npt.NDArray[np.float32], reduce: np.ufunc
    ) -> Iterator[tuple[npt.NDArray[np.void], Ordinals, Ordinals, npt.NDArray[np.float32]]]:
        """By block: its cells, rows and columns of those touched, each once, and their values reduced."""
        if not len(points_m):
            return
        cells = self._cells(points_m)
        keys = ((cells[:, 0] + _SPAN) << 32) | (cells[:, 1] + _SPAN)
        order = np.argsort(keys, kind="stable")
        starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
        reduced, cells = reduce.reduceat(values[order], starts), cells[order[starts]]
        for block, part in _by_block(cells):
            column, row = (cells[part] % BLOCK).T
            yield self._blocks.setdefault(block, np.full((BLOCK, BLOCK), _NEVER)), row, column, reduced[part]


def _by_block(cells: npt.NDArray[np.int64]) -> Iterator[tuple[Block, Ordinals]]:
    """Each block with the ordinals of its cells (n, 2)."""
    x, y = (cells // BLOCK).T
    order = np.lexsort((y, x))
    edges = np.flatnonzero((np.diff(x[order]) != 0) | (np.diff(y[order]) != 0)) + 1
    for part in np.split(order, edges) if len(order) else ():
        yield (int(x[part[0]]), int(y[part[0]])), part


def _sampled(cells: npt.NDArray[np.void]) -> Sampled:
    nowhere = cells["views"] == 0
    probability = np.where(nowhere, np.float32(np.nan), expit(cells["log_odds"]))
    return Sampled(cells["views"], probability, np.where(nowhere, np.float32(np.nan), cells["sigma_m"]))
