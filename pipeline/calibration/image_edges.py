"""How strongly a picture changes across each of some directions."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.calibration.board import Image
from pipeline.calibration.turning import Array

DIRECTIONS = 8
_ACROSS_PX, _ALONG_PX, _HALF = 1.2, 5.0, 12
_AROUND_PX = 20.0
_STRONGEST = 6.0
Strength = npt.NDArray[np.float32]


def edge_strength(image_bgr: Image) -> Strength:
    """(directions, height, width): contrast across lines, against what is usual around; direction k is k * 22.5 deg.

    Long thin filters: leaves are edges in all directions, a stem in one, for some length.
    """
    lab = cv2.cvtColor(image_bgr, cv2.COLOR_BGR2LAB).astype(np.float32)
    raw = np.stack([_across(lab, np.pi * k / DIRECTIONS) for k in range(DIRECTIONS)])
    usual = cv2.GaussianBlur(raw.mean(axis=0), (0, 0), _AROUND_PX) + 0.5
    return np.asarray(np.minimum(raw / usual, _STRONGEST), np.float32)


def blurred(strength: Strength, sigma_px: float) -> Strength:
    """The same for who does not know yet where to look, without its mean: to be outside is to be average."""
    maps = [cv2.GaussianBlur(one, (0, 0), sigma_px) for one in strength]
    return np.stack([one - one.mean() for one in maps]).astype(np.float32)


def facing(outward: Array) -> npt.NDArray[np.int64]:
    """(n,) which of the directions a line has whose normal is outward (n, 2)."""
    angle = np.arctan2(outward[:, 1], outward[:, 0])
    return np.asarray(np.rint(angle / (np.pi / DIRECTIONS)).astype(np.int64) % DIRECTIONS)


def _across(lab: npt.NDArray[np.float32], angle: float) -> npt.NDArray[np.float32]:
    x, y = np.meshgrid(*[np.arange(-_HALF, _HALF + 1)] * 2)
    a, b = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    kernel = -a * np.exp(-0.5 * (a / _ACROSS_PX) ** 2 - 0.5 * (b / _ALONG_PX) ** 2)
    kernel = (kernel / np.abs(kernel).sum()).astype(np.float32)
    changes = [np.abs(cv2.filter2D(lab[..., channel], cv2.CV_32F, kernel)) for channel in range(3)]
    return np.asarray(sum(changes), np.float32)
