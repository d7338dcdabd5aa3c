"""What the LiDAR map looks like from the camera: a range for each cell of the image."""

from __future__ import annotations

from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from pipeline.camera import CameraModel
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.lens_kernels import look, splat, unhidden
from pipeline.grounding.surroundings import Surroundings
from pipeline.grounding.views import CameraView

Array = npt.NDArray[np.float64]
USUAL_WIDTH_PX = 848


class DepthImage:
    """range_m: (rows, cols) float32, infinite where no point is. seen: pixel and range of all points around."""

    def __init__(self, view: CameraView, around: Surroundings, config: GroundingConfig) -> None:
        self.view = view
        self.ground = around.ground
        self.cell_px = max(1.0, config.cell_px * view.model.width_px / USUAL_WIDTH_PX)
        self._lens = lens_numbers(view.model)
        self._size = np.array([view.model.width_px, view.model.height_px], np.float64)
        self._ranges = np.array([0.2, config.farthest_m + 4.0])
        self._behind_m = config.behind_m
        rows, cols = (int(np.ceil(side / self.cell_px)) for side in (view.model.height_px, view.model.width_px))
        self.range_m = np.full((rows, cols), np.inf, np.float32)
        self.seen = self.look(around.points_m)
        splat(self.seen, self.cell_px, 0.5 * config.splat_m * self._lens[0], self.range_m)

    def look(self, points_m: Array) -> npt.NDArray[np.float32]:
        """(n, 3) pixel and range of points (n, 3); range 0 for those outside of the image."""
        view = self.view
        return np.asarray(look(points_m, view.rotation, view.position_m, self._lens, self._size, self._ranges))

    def unhidden(self, seen: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        """(n,) of what `look` gave: nothing stands before them."""
        return np.asarray(unhidden(seen, self.cell_px, self._behind_m, self.range_m))

    @cached_property
    def places_m(self) -> Array:
        """(rows, cols, 3) of the cells' points, infinite where there is none."""
        rays = cell_rays(self.view.model, self.cell_px) @ self.view.rotation.T
        with np.errstate(invalid="ignore"):
            return np.asarray(self.view.position_m + rays * self.range_m[..., None])


@lru_cache(maxsize=8)
def lens_numbers(model: CameraModel) -> Array:
    """For the kernels."""
    (fx, fy), (cx, cy) = model.focal_px, model.centre_px
    distortion = (*model.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
    w, h = model.width_px - 1.0, model.height_px - 1.0
    border = model.rays(np.array([[0.0, 0.0], [w, 0.0], [0.0, h], [w, h], [cx, 0.0], [cx, h], [0.0, cy], [w, cy]]))
    widest = 1.1 * float((np.hypot(border[:, 0], border[:, 1]) / np.maximum(border[:, 2], 1e-3)).max())
    return np.array([fx, fy, cx, cy, float(model.model == "fisheye"), *distortion, widest])


@lru_cache(maxsize=8)
def cell_rays(model: CameraModel, cell_px: float) -> Array:
    """(rows, cols, 3) unit vectors through the middles of the cells, in the optical frame."""
    rows, cols = (int(np.ceil(side / cell_px)) for side in (model.height_px, model.width_px))
    v, u = np.indices((rows, cols))
    pixels: Array = np.column_stack([u.ravel(), v.ravel()]).astype(np.float64) * cell_px + 0.5 * cell_px - 0.5
    return model.rays(pixels).reshape(rows, cols, 3)
