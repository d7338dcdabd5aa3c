"""How sharp an image is: the variance of its Laplacian (Pech-Pacheco et al. 2000).

It compares images of one scene and camera; foliage scores far above a bare wall, whatever the focus.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

LONGEST_PX = 1024
"""Larger images are measured at this size, so that a photo and a frame of video can be told side by side."""


def sharpness(grey: npt.NDArray[np.uint8]) -> float:
    """Of a grey image (h, w), in squared grey values."""
    return float(cv2.meanStdDev(cv2.Laplacian(_small(grey), cv2.CV_16S))[1][0, 0] ** 2)


def _small(grey: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    longest = max(grey.shape)
    if longest <= LONGEST_PX:
        return grey
    size = (round(grey.shape[1] * LONGEST_PX / longest), round(grey.shape[0] * LONGEST_PX / longest))
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.uint8)
