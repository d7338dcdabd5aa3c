"""Where the camera sits, seen from the LiDAR, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.calibration.turning import Array


@dataclass(frozen=True, slots=True, eq=False)
class Extrinsics:
    """Brings points of `livox_frame` into the optical frame: rotation (3, 3) @ p + translation_m (3,)."""

    rotation: Array
    translation_m: Array

    def apply(self, points_m: Array) -> Array:
        """Points (n, 3) in the optical frame."""
        return np.asarray(points_m @ self.rotation.T + self.translation_m)

    def moved(self, step: Array) -> Extrinsics:
        """After a small turn (rad) and then a shift (m) in the optical frame, step (6,)."""
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        return Extrinsics(turn @ self.rotation, turn @ self.translation_m + step[3:])

    def step_from(self, other: Extrinsics) -> Array:
        """(6,): `other.moved(step)` is this."""
        turn = self.rotation @ other.rotation.T
        shift = self.translation_m - turn @ other.translation_m
        return np.concatenate([Rotation.from_matrix(turn).as_rotvec(), shift])

    @property
    def camera_m(self) -> Array:
        """(3,) position of the camera in `livox_frame`."""
        return np.asarray(-self.rotation.T @ self.translation_m)


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """covariance: (6, 6), of the step of `Extrinsics.moved`. refusal: why it cannot be told; empty: it can."""

    extrinsics: Extrinsics
    covariance: Array
    refusal: str = ""

    @property
    def rotation_sigma_deg(self) -> float:
        """About the axis that is known least."""
        return float(np.degrees(np.sqrt(max(np.linalg.eigvalsh(self.covariance[:3, :3])[-1], 0.0))))

    @property
    def translation_sigma_m(self) -> float:
        """Of the camera's position, in the direction that is known least."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance[3:, 3:])[-1], 0.0)))
