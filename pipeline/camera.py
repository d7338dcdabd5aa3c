"""A camera as the geometry sees it: where a point of the optical frame lands in the image, and the ray of a pixel.

Optical frame: x right, y down, z forward. Pixel (0, 0) is the centre of the first one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
LensModel = Literal["pinhole", "fisheye"]
NEAREST_M = 0.05
WIDEST_RAD = np.radians(85.0)
"""Rays farther off the axis are not projected: a distortion polynomial folds back there."""
REFINED = 10
"""Steps after OpenCV's five, which end up to half a pixel off; its way to ask for more differs by version."""


@dataclass(frozen=True, slots=True)
class CameraModel:
    """Intrinsics of one lens mode at one resolution.

    model: "pinhole" with distortion k1 k2 p1 p2 k3 (Brown 1966), or "fisheye" with k1 k2 k3 k4 (Kannala and Brandt
    2006), as OpenCV has them. focal_px: fx, fy. centre_px: cx, cy.
    """

    width_px: int
    height_px: int
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    model: LensModel = "pinhole"
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def matrix(self) -> Array:
        """(3, 3) camera matrix."""
        (fx, fy), (cx, cy) = self.focal_px, self.centre_px
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    def project(self, points_m: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Pixels (n, 2) of points (n, 3) in the optical frame, and which of them (n,) are in front and in the image."""
        pixels = np.full((len(points_m), 2), np.nan)
        off_axis = np.hypot(points_m[:, 0], points_m[:, 1])
        ahead = (points_m[:, 2] > NEAREST_M) & (off_axis < np.tan(WIDEST_RAD) * points_m[:, 2])
        if ahead.any():
            pixels[ahead] = self._project(points_m[ahead])
        u, v = pixels[:, 0], pixels[:, 1]
        with np.errstate(invalid="ignore"):
            inside = (u > -0.5) & (u < self.width_px - 0.5) & (v > -0.5) & (v < self.height_px - 0.5)
        return pixels, inside

    def rays(self, pixels: Array) -> Array:
        """Unit vectors (n, 3) in the optical frame through pixels (n, 2)."""
        if not len(pixels):
            return np.empty((0, 3))
        straight = self.model == "pinhole" and not any(self.distortion)
        flat = (np.asarray(pixels, np.float64) - self.centre_px) / self.focal_px if straight else self._undone(pixels)
        rays = _at_one_metre(flat)
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))

    def resized(self, width_px: int, height_px: int) -> CameraModel:
        """The same lens in an image of another size that shows the same field of view."""
        sx, sy = width_px / self.width_px, height_px / self.height_px
        (fx, fy), (cx, cy) = self.focal_px, self.centre_px
        centre = ((cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5)
        return replace(self, width_px=width_px, height_px=height_px, focal_px=(fx * sx, fy * sy), centre_px=centre)

    def _undone(self, pixels: Array) -> Array:
        """Where the lens would show pixels (n, 2) if it were straight, at one metre: OpenCV's guess made exact."""
        given = np.ascontiguousarray(pixels, np.float64).reshape(-1, 1, 2)
        undo = cv2.fisheye.undistortPoints if self.model == "fisheye" else cv2.undistortPoints
        flat = np.asarray(undo(given, self.matrix, np.array(self.distortion)), np.float64).reshape(-1, 2)
        for _ in range(REFINED):
            flat = flat - (self._project(_at_one_metre(flat)) - given.reshape(-1, 2)) / self.focal_px
        return flat

    def _project(self, points_m: Array) -> Array:
        given, still = np.ascontiguousarray(points_m, np.float64).reshape(-1, 1, 3), np.zeros(3)
        if self.model == "fisheye":
            pixels, _ = cv2.fisheye.projectPoints(given, still, still, self.matrix, np.array(self.distortion))
        else:
            pixels, _ = cv2.projectPoints(given, still, still, self.matrix, np.array(self.distortion))
        return np.asarray(pixels, np.float64).reshape(-1, 2)


def _at_one_metre(flat: Array) -> Array:
    return np.column_stack([flat, np.ones(len(flat))])
