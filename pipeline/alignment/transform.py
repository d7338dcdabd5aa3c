"""A ground map is level: four numbers bring it onto another map."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Transform:
    """Turn by yaw_deg (counter-clockwise, about the vertical through the pivot), then shift by x, y, z.

    pivot_m: in the frame that the points come from. The shift is small and means something where the pivot lies; the
    last column of a matrix is hundreds of kilometres, and does not.
    """

    pivot_m: tuple[float, float]
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    yaw_deg: float = 0.0

    def apply(self, points_m: Array) -> Array:
        """(n, 2) or (n, 3) -> the same in the other frame."""
        turn = rotation(self.yaw_deg)
        pivot = np.array(self.pivot_m)
        flat = (points_m[:, :2] - pivot) @ turn.T + (pivot + [self.x_m, self.y_m])
        return flat if points_m.shape[1] == 2 else np.column_stack([flat, points_m[:, 2] + self.z_m])

    def inverse(self) -> Transform:
        """Back again."""
        x, y = self.pivot_m[0] + self.x_m, self.pivot_m[1] + self.y_m
        return Transform((x, y), -self.x_m, -self.y_m, -self.z_m, -self.yaw_deg)

    def after(self, first: Transform) -> Transform:
        """`first`, then this one, about the pivot of `first`."""
        at = np.array([first.pivot_m])
        x, y = (self.apply(first.apply(at)) - at)[0].tolist()
        return Transform(first.pivot_m, x, y, self.z_m + first.z_m, wrapped_deg(self.yaw_deg + first.yaw_deg))

    def about(self, pivot_m: tuple[float, float]) -> Transform:
        """The same with another pivot."""
        return self.after(Transform(pivot_m))

    def matrix(self) -> Array:
        """(4, 4), homogeneous."""
        found = np.eye(4)
        found[:2, :2] = rotation(self.yaw_deg)
        found[:2, 3] = self.apply(np.zeros((1, 2)))[0]
        found[2, 3] = self.z_m
        return found


def rotation(yaw_deg: float) -> Array:
    """(2, 2), counter-clockwise."""
    c, s = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    return np.array([[c, -s], [s, c]])


def wrapped_deg(angle_deg: float) -> float:
    """-180 to 180."""
    return (angle_deg + 180.0) % 360.0 - 180.0
