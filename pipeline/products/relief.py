"""The map from above as a picture: the ground shaded, what stands on it up to head height dark."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy import ndimage

Array = npt.NDArray[np.float64]
_GROUND_M = 0.5
_STEEPER = 2.0
"""Heights are exaggerated by this: a forest floor is flat."""
_LIGHT = np.array([-1.0, 1.0, 1.4]) / np.linalg.norm([-1.0, 1.0, 1.4])
"""From the north-west, towards it."""
_STEMS_M = (0.5, 3.0)
"""Above the ground: stems and undergrowth."""
_REACHES_M, _STANDS_OUT_M, _STEEPEST = (1.5, 4.0), 0.5, 1.2
"""A cell whose lowest point is higher above another within reach than any slope explains holds no ground."""
_WEIGHT = 0.15
"""Share of ground around a cell that it takes to tell its height."""
_LEVELS = 28
"""Of grey: the eye sees no more here, and the file is a third of the size."""
_LONGEST_PX = 1100
_FINEST_M = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """png: grey and alpha, clear where there are no points. Edges in the coordinates of the points."""

    png: bytes
    west: float
    east: float
    south: float
    north: float


def relief(points: Callable[[], Iterable[Array]], bounds: tuple[float, float, float, float]) -> Relief | None:
    """points: called twice, gives (n, 3) at a time. bounds: west, south, east, north. None without points in them."""
    west, south, east, north = bounds
    cell_m = max(_FINEST_M, (east - west) / _LONGEST_PX, (north - south) / _LONGEST_PX)
    fine = _Cells(west, north, cell_m, int((north - south) / cell_m) + 1, int((east - west) / cell_m) + 1)
    coarse = fine.coarser(max(1, round(_GROUND_M / cell_m)))
    ground = coarse.lowest(points())
    if not np.isfinite(ground).any():
        return None
    ground = _smooth_ground(ground, coarse.cell_m)
    stems, any_points = fine.count(points(), coarse, ground)
    shade = cv2.resize(_shaded(ground, coarse.cell_m), (fine.columns, fine.rows), interpolation=cv2.INTER_LINEAR)
    dark = np.minimum(np.log1p(stems) / np.log1p(np.percentile(stems[stems > 0], 97) if stems.any() else 1.0), 1.0)
    grey = (_LEVELS * shade * (1.0 - 0.75 * dark)).astype(np.uint8) * (255 // _LEVELS)
    alpha = np.where(ndimage.binary_closing(any_points, iterations=4), 255, 0).astype(np.uint8)
    picture = np.dstack([grey, grey, grey, alpha])
    right, bottom = west + fine.columns * cell_m, north - fine.rows * cell_m
    return Relief(bytes(cv2.imencode(".png", picture)[1]), west, right, bottom, north)


@dataclass(frozen=True, slots=True)
class _Cells:
    """A raster, north up."""

    west: float
    north: float
    cell_m: float
    rows: int
    columns: int

    def coarser(self, times: int) -> _Cells:
        return _Cells(self.west, self.north, self.cell_m * times, -(-self.rows // times), -(-self.columns // times))

    def index(self, points: Array) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
        """Flat, and which of the points lie inside."""
        column = np.floor((points[:, 0] - self.west) / self.cell_m).astype(np.intp)
        row = np.floor((self.north - points[:, 1]) / self.cell_m).astype(np.intp)
        inside = (column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows)
        return (row * self.columns + column)[inside], inside

    def lowest(self, parts: Iterable[Array]) -> npt.NDArray[np.float32]:
        """(rows, columns); infinite where there are no points."""
        found = np.full(self.rows * self.columns, np.inf, np.float32)
        for points in parts:
            cells, inside = self.index(points)
            np.minimum.at(found, cells, points[inside, 2].astype(np.float32))
        return found.reshape(self.rows, self.columns)

    def count(
        self, parts: Iterable[Array], coarse: _Cells, ground: npt.NDArray[np.float32]
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
        """(rows, columns) points that stand up from the ground, and whether there are any."""
        standing = np.zeros(self.rows * self.columns, np.int64)
        everything = np.zeros(self.rows * self.columns, bool)
        low, high = _STEMS_M
        for points in parts:
            cells, inside = self.index(points)
            below, _ = coarse.index(points[inside])
            above = points[inside, 2] - ground.ravel()[below]
            everything[cells] = True
            standing += np.bincount(cells[(above > low) & (above < high)], minlength=len(standing))
        return standing.reshape(self.rows, self.columns), everything.reshape(self.rows, self.columns)


def _smooth_ground(lowest: npt.NDArray[np.float32], cell_m: float) -> npt.NDArray[np.float32]:
    """From the lowest points: cells in which only leaves were seen stand out of their neighbourhood and are left out,
    and what is missing is filled from around.
    """
    valid = np.isfinite(lowest)
    for reach_m in _REACHES_M:
        around = 2 * max(1, round(reach_m / cell_m)) + 1
        valid &= lowest < ndimage.grey_erosion(lowest, size=(around, around)) + _STANDS_OUT_M + _STEEPEST * reach_m
    ground = np.full(lowest.shape, np.nan)
    weighed = np.where(valid, lowest, 0.0)
    for reach_m in (0.5, 1.5, 5.0, 20.0, 100.0):
        sigma = reach_m / cell_m
        weight = ndimage.gaussian_filter(valid.astype(np.float64), sigma)
        known = np.isnan(ground) & (weight > _WEIGHT)
        ground[known] = ndimage.gaussian_filter(weighed, sigma)[known] / weight[known]
    return np.where(np.isnan(ground), lowest[valid].mean(), ground).astype(np.float32)


def _shaded(ground: npt.NDArray[np.float32], cell_m: float) -> npt.NDArray[np.float32]:
    """0..1, after Lambert."""
    if min(ground.shape) < 2:
        return np.full(ground.shape, 0.8, np.float32)
    down, right = np.gradient(ground * _STEEPER, cell_m)
    normal = np.dstack([-right, down, np.ones_like(ground)])
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    return np.asarray(np.clip(0.25 + 0.75 * (normal @ _LIGHT), 0.0, 1.0), np.float32)
