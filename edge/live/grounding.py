"""The live detector's boxes on the live map: how many trees there are, and where the last one stands."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from edge.control.messages import Mapped
from edge.process.estimators import Tracked
from pipeline.detections import FrameDetections
from pipeline.estimates import OdometryEstimate
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.grounding import Grounding
from pipeline.grounding.sources import RollingPoints
from pipeline.grounding.views import CameraRig, Pose, camera_view

POSES_HELD = 100
"""Ten seconds: a slow detector's boxes come late."""
MOST_WAITING = 8


class LiveGrounding:
    """Poses and boxes in, in any order. One thread. Every `odom` that begins anew begins an empty map."""

    def __init__(self, rig: CameraRig, config: GroundingConfig) -> None:
        self._rig = rig
        self._config = config
        self._poses: deque[Pose] = deque(maxlen=POSES_HELD)
        self._waiting: deque[FrameDetections] = deque(maxlen=MOST_WAITING)
        self._travelled_m = 0.0
        self._points = RollingPoints()
        self._grounding = Grounding(self._points, config, by_point=False)

    def track(self, tracked: Tracked) -> None:
        """A sweep was located."""
        estimate = tracked.estimate
        if self._poses and estimate.travelled_m < self._travelled_m:
            self._begin()
        self._travelled_m = estimate.travelled_m
        self._poses.append(Pose(estimate.stamp_ns, estimate.rotation, estimate.position_m))
        self._points.add(tracked.cloud[:, :3])
        self._look()

    def see(self, found: FrameDetections) -> None:
        """An image was looked at; it waits for the pose at its time."""
        self._waiting.append(found)
        self._look()

    def mapped(self, estimate: OdometryEstimate | None) -> Mapped:
        """For the operator; bearings are clockwise from where the payload heads."""
        trees = self._grounding.probable()
        if not trees or estimate is None:
            return Mapped(len(trees), self._grounding.counts.views)
        last = max(trees, key=lambda tree: tree.last_ns)
        away = last.mean_m - estimate.position_m[:2]
        heading = math.atan2(estimate.rotation[1, 0], estimate.rotation[0, 0])
        bearing = math.degrees(heading - math.atan2(away[1], away[0])) % 360.0
        sigma_m = float(np.sqrt(np.linalg.eigvalsh(last.covariance)[-1]))
        return Mapped(len(trees), self._grounding.counts.views, float(np.hypot(*away)), bearing, sigma_m)

    def _begin(self) -> None:
        self._poses.clear()
        self._points = RollingPoints()
        self._grounding = Grounding(self._points, self._config, by_point=False)

    def _look(self) -> None:
        poses = self._poses
        late_ns = round(self._rig.late_s * 1e9)
        while self._waiting and poses and poses[-1].stamp_ns >= self._waiting[0].stamp_ns - late_ns:
            found = self._waiting.popleft()
            after = next((k for k, pose in enumerate(poses) if pose.stamp_ns >= found.stamp_ns - late_ns), 0)
            rig = self._rig.for_images(found.width_px, found.height_px)
            view = camera_view(found.stamp_ns, poses[after - 1], poses[after], rig) if after and rig else None
            if view is not None:
                self._grounding.look(view, found)
