"""Where stems may be: places above which points stand over each other, layer by layer, leaning or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from pipeline.inventory import circle_kernels as kernels
from pipeline.inventory.config import InventoryConfig

Doubles = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
CELL_M, LAYER_M, WINDOW_M = 0.1, 0.25, 2.0
STANDING = 0.6
"""Share of the layers of a window that a stem fills: parts of it are hidden."""
APART_M = 0.3
"""Candidates are not nearer to each other; two stems that are share one, and are told apart by their circles."""
INDEX_M = 0.25
MOST_SEEDS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class Layered:
    """Points of a block sorted by place: xyh (n, 3) x, y and height above the ground; sensor (n, 2), NaN where the map
    does not say; reflector (n,)."""

    xyh: Doubles
    sensor: Doubles
    reflector: npt.NDArray[np.bool_]
    low: tuple[float, float]
    shape: tuple[int, int]
    starts: Indices

    @classmethod
    def of(cls, points: npt.NDArray[np.void]) -> Layered:
        """(n,) of `blocks.POINT`, n > 0."""
        xy = points["xyz"][:, :2].astype(np.float64)
        low = xy.min(axis=0) - INDEX_M
        cells = ((xy - low) / INDEX_M).astype(np.int64)
        nx, ny = (cells.max(axis=0) + 2).tolist()
        flat = cells[:, 0] * ny + cells[:, 1]
        order = np.argsort(flat, kind="stable")
        starts = np.searchsorted(flat[order], np.arange(nx * ny + 1))
        xyh = np.column_stack([xy, points["height"]])[order]
        return cls(
            np.ascontiguousarray(xyh),
            points["sensor"][order].astype(np.float64),
            points["reflector"][order],
            (float(low[0]), float(low[1])),
            (nx, ny),
            starts.astype(np.int64),
        )

    def near(self, x: float, y: float, radius_m: float) -> Indices:
        """Rows of xyh within a radius, level."""
        found: Indices = kernels.gather(self.starts, self.shape, self.low, INDEX_M, self.xyh, x, y, radius_m)
        return found


def seeds(points: Layered, config: InventoryConfig) -> Doubles:
    """(k, 2) places, those that most layers and points speak for first."""
    xyh = points.xyh
    some = (xyh[:, 2] >= config.lowest_m) & (xyh[:, 2] < config.highest_m)
    if not some.any():
        return np.empty((0, 2))
    xy, height = xyh[some, :2], xyh[some, 2]
    origin = xy.min(axis=0) - 2 * CELL_M
    cell = ((xy - origin) / CELL_M).astype(np.int64)
    layers = max(1, round((config.highest_m - config.lowest_m) / LAYER_M))
    layer = np.minimum(((height - config.lowest_m) / LAYER_M).astype(np.int64), layers - 1)
    count = np.zeros((layers, *(cell.max(axis=0) + 3)), np.uint16)
    np.add.at(count, (layer, cell[:, 0], cell[:, 1]), 1)
    # A stem is rough and leans: what stands in the next cell counts.
    filled = ndimage.maximum_filter(count > 0, size=(1, 3, 3))
    window = min(layers, max(1, round(WINDOW_M / LAYER_M)))
    summed = np.cumsum(filled, axis=0, dtype=np.int32)
    summed[window:] -= summed[:-window].copy()
    share = summed[window - 1 :].max(axis=0) / window
    # Points of a layer count by their root: a near stem must not outshine what stands beside it.
    weight = ndimage.uniform_filter(np.sqrt(count, dtype=np.float32).sum(axis=0), 3)
    score = np.where(share >= STANDING, share * weight, 0.0)
    reach = round(APART_M / CELL_M)
    peaks = np.argwhere((score > 0) & (score >= ndimage.maximum_filter(score, size=2 * (reach // 2) + 1)))
    order = np.argsort(-score[peaks[:, 0], peaks[:, 1]], kind="stable")[:MOST_SEEDS]
    return np.asarray(origin + (peaks[order] + 0.5) * CELL_M)
