"""Individuals that detections were put on, as everything after the grounding takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class View:
    """One image that shows a tree. box_px: x_min, y_min, x_max, y_max. range_m: camera to tree."""

    stamp_ns: int
    box_px: tuple[float, float, float, float]
    confidence: float
    range_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """position_m: (3,) base of the stem, or of what was seen, in `frame`; covariance: (3, 3) m^2, of pose, calibration,
    timing and spread of the views.

    probability: that it is a `class_name`, from all views. views: images in which it stood unhidden; hits: of these,
    those that detected it. height_m, crown_m (diameter): NaN where not seen. best: the views to show, best first.
    """

    tree_id: int
    class_name: str
    frame: str
    """`map` or `odom`."""
    position_m: Array
    covariance: Array
    probability: float
    views: int
    hits: int
    points: int
    """Of the LiDAR map that carry the label."""
    stem_seen: bool
    """position_m is on a stem; otherwise below the middle of the crown."""
    height_m: float
    crown_m: float
    first_ns: int
    last_ns: int
    best: tuple[View, ...]

    @property
    def sigma_m(self) -> float:
        """Horizontal: root of the larger eigenvalue."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[:2, :2])[-1]))
