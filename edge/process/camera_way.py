"""The way of a session's camera: where it was at each exposure, in `odom`, and by the placement in `map`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipeline.grounding.placed import to_map
from pipeline.grounding.views import CameraRig, CameraView, Pose, camera_view
from pipeline.products.covariance import horizontal_sigma_m
from pipeline.products.track import Placement
from pipeline.trees import Tree

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CameraWay:
    """track: of the odometry. placement: None where nothing else tells of the session."""

    track: npt.NDArray[np.void]
    placement: Placement | None
    rig: CameraRig

    def view(self, stamp_ns: int, width_px: int, height_px: int) -> tuple[CameraView, int] | None:
        """Of an image in `odom`, and the first sweep after its exposure; None where the track does not tell, or the
        image is not of the calibrated shape."""
        exposed_ns = stamp_ns - round(self.rig.late_s * 1e9)
        after = int(np.searchsorted(self.track["stamp_ns"], exposed_ns))
        rig = self.rig.for_images(width_px, height_px)
        if rig is None or not 0 < after < len(self.track):
            return None
        view = camera_view(stamp_ns, _pose(self.track[after - 1]), _pose(self.track[after]), rig)
        return None if view is None else (view, after)

    def points(self, odom_m: Array, sweeps: npt.NDArray[np.integer]) -> Array:
        """(n, 3) where they are on the map."""
        return odom_m if self.placement is None else self.placement.points(odom_m, sweeps)

    def on_map(self, view: CameraView, sweep: int) -> CameraView:
        """A view where it is on the map."""
        eye, *ahead = self.points(view.position_m + np.vstack([np.zeros(3), view.rotation.T]), np.full(4, sweep))
        return replace(view, position_m=eye, rotation=(np.array(ahead) - eye).T)

    def sigma_m(self, sweep: int) -> float:
        """Of the place, in plan."""
        covariance = self.track["covariance"] if self.placement is None else self.placement.covariance
        return float(horizontal_sigma_m(covariance[sweep : sweep + 1])[0])

    def placed(self, trees: list[Tree]) -> list[Tree]:
        """On the map."""
        return trees if self.placement is None else to_map(trees, self.placement, self.track["stamp_ns"])


def _pose(record: np.void) -> Pose:
    return Pose(int(record["stamp_ns"]), record["rotation"], record["position_m"])
