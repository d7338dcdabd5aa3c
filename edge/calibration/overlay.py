"""LiDAR points drawn over the picture: the eye sees at once whether a calibration is right."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.calibration.board import Image
from pipeline.calibration.extrinsics import Extrinsics
from pipeline.calibration.turning import Array
from pipeline.camera import CameraModel

NEAR_M, FAR_M = 1.0, 30.0
DIMMED = 0.6


def overlay(image_bgr: Image, points_m: Array, extrinsics: Extrinsics, camera: CameraModel) -> Image:
    """points_m: (n, 3) in `livox_frame`. Red is near, blue far, on a logarithmic scale; near points cover far ones."""
    grey = cv2.cvtColor(cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    canvas = np.asarray(grey * DIMMED, np.uint8)
    seen = extrinsics.apply(points_m)
    pixels, inside = camera.project(seen)
    distance = np.linalg.norm(seen, axis=1)
    order = np.flatnonzero(inside)[np.argsort(-distance[inside])]
    share = np.log(np.clip(distance[order], NEAR_M, FAR_M) / NEAR_M) / np.log(FAR_M / NEAR_M)
    shades = np.asarray(255.0 * (1.0 - share), np.uint8).reshape(-1, 1)
    colours = np.asarray(cv2.applyColorMap(shades, cv2.COLORMAP_TURBO), np.uint8).reshape(-1, 3)
    size = max(1, camera.width_px // 800)
    for (u, v), colour in zip(np.round(pixels[order]).astype(int).tolist(), colours.tolist(), strict=True):
        cv2.circle(canvas, (u, v), size, colour, -1)
    return canvas
