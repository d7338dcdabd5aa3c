"""The compiled kernels loaded, or compiled, before they are needed."""

from __future__ import annotations

import numpy as np

from pipeline.camera import CameraModel
from pipeline.detections import FrameDetections
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.grounding import Grounding
from pipeline.grounding.sources import RollingPoints
from pipeline.grounding.views import CameraView

AHEAD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def warm_up() -> None:
    """Look once at a post on the ground, with a box around it."""
    random = np.random.default_rng(0)
    ground = random.uniform([0, -5, 0], [12, 5, 0.05], (3000, 3))
    post = random.uniform([5.9, -0.1, 0], [6.1, 0.1, 4], (3000, 3))
    points = RollingPoints()
    points.add(np.concatenate([ground, post]).astype(np.float32))
    view = CameraView(0, CameraModel(848, 480, (432.0, 432.0), (423.5, 239.5)), AHEAD, np.array([0.0, 0.0, 1.3]))
    box, sure, kind = np.array([[400.0, 50.0, 447.0, 330.0]]), np.array([0.8]), np.zeros(1, np.int64)
    Grounding(points, GroundingConfig()).look(view, FrameDetections(0, 848, 480, box, sure, kind, ("tree",)))
