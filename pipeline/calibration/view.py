"""A picture as a pinhole camera of moderate width would have taken it, whatever the lens."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.calibration.board import Image
from pipeline.camera import CameraModel

WIDTH_PX = 848
WIDEST_RAD = np.radians(48.0)
"""Half of it: farther out a pinhole stretches everything."""


@dataclass(frozen=True, slots=True, eq=False)
class Straightener:
    """Maps pictures of `camera` to those of `pinhole`, which looks the same way."""

    camera: CameraModel
    pinhole: CameraModel

    @classmethod
    def of(cls, camera: CameraModel) -> Straightener:
        """As wide as the lens, but no wider than `WIDEST_RAD` to each side."""
        middle = np.array([[0.0, camera.centre_px[1]], [camera.width_px - 1.0, camera.centre_px[1]]])
        rays = camera.rays(middle)
        half = min(float(np.max(np.arctan2(np.abs(rays[:, 0]), rays[:, 2]))), float(WIDEST_RAD))
        width = min(WIDTH_PX, camera.width_px)
        height = round(width * camera.height_px / camera.width_px)
        focal = 0.5 * width / np.tan(half)
        centre = ((width - 1) / 2.0, (height - 1) / 2.0)
        return cls(camera, CameraModel(width, height, (focal, focal), centre))

    def straight(self, image: Image) -> Image:
        """(height, width, 3) of the pinhole."""
        rows, columns = np.mgrid[: self.pinhole.height_px, : self.pinhole.width_px]
        pixels = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64)
        (focal, _), centre = self.pinhole.focal_px, np.array(self.pinhole.centre_px)
        rays = np.column_stack([(pixels - centre) / focal, np.ones(len(pixels))])
        at, _ = self.camera.project(rays)
        table = np.nan_to_num(at, nan=-1.0).astype(np.float32).reshape(*rows.shape, 2)
        size = self.camera.width_px / self.pinhole.width_px
        soft = cv2.GaussianBlur(image, (0, 0), 0.4 * size) if size > 1.2 else image
        return np.asarray(cv2.remap(soft, table[..., 0], table[..., 1], cv2.INTER_LINEAR), np.uint8)
