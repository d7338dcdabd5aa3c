"""A simulated payload that walks through a forest, and stands in it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from drivers.sim.camera import Camera, exposure_ns
from drivers.sim.lidar import LEVER_M, Lidar
from drivers.sim.renderer import Renderer
from drivers.sim.scenarios import scenario
from drivers.sim.world import World, build
from pipeline.calibration.extrinsics import Extrinsics
from pipeline.calibration.image_turning import Picture
from pipeline.calibration.scene_extrinsics import Stand
from pipeline.calibration.turning import Turning, of_gyro
from pipeline.camera import CameraModel

LENS = CameraModel(848, 480, (432.0, 432.0), (423.5, 239.5))
CAMERA = Camera()
TRUE = Extrinsics(CAMERA.rotation.T, CAMERA.rotation.T @ (np.array(LEVER_M) - np.array(CAMERA.position_m)))
ROLLS_DEG = (0.0, 70.0, -70.0, 0.0, 70.0, -70.0)
"""Of the payload at the places where it stands: upright stems alone say little about height."""
STAND_S = 3.0
_GLUED = 0x0F


@dataclass(frozen=True, slots=True, eq=False)
class _Still:
    """Poses of what does not move."""

    position_m: npt.NDArray[np.float64]
    rotation: npt.NDArray[np.float64]

    def poses(self, t_ns: npt.ArrayLike) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        count = np.size(t_ns)
        return np.tile(self.position_m, (count, 1)), np.tile(self.rotation, (count, 1, 1))


def world(name: str, seed: int) -> World:
    """A walk of that scenario."""
    return build(scenario(name, seed))


def walk(seen: World, begin_s: float, seconds: float, late_s: float):
    """Pictures, stamped late, and the turning of the IMU with its noise and bias."""
    renderer = Renderer(seen.scene, seen.trajectory, CAMERA, seen.config.seed)
    first = round(begin_s * 30000 / 1001)

    def pictures():
        for index in range(first, first + round(seconds * 30000 / 1001)):
            grey = cv2.cvtColor(renderer.render(exposure_ns(index)), cv2.COLOR_RGB2GRAY)
            yield Picture(exposure_ns(index) + round(late_s * 1e9), grey)

    return pictures(), imu(seen, begin_s - 2.0, seconds + 4.0)


def imu(seen: World, begin_s: float, seconds: float) -> Turning:
    """200 Hz."""
    stamps = np.arange(round(max(begin_s, 0.0) * 1e9), round((begin_s + seconds) * 1e9), 5_000_000)
    return of_gyro(stamps, np.array([seen.imu.sample(int(at))[0] for at in stamps]))


def stands(seen: World, places: int) -> list[Stand]:
    """Along the way, upright and rolled."""
    renderer = Renderer(seen.scene, seen.trajectory, CAMERA, seen.config.seed)
    found = []
    for number, roll in enumerate(ROLLS_DEG[:places]):
        at_ns = round(seen.trajectory.duration_ns * (number + 0.5) / places)
        position, rotation = seen.trajectory.poses([at_ns])
        turned = rotation[0] @ Rotation.from_euler("x", roll, degrees=True).as_matrix()
        still = _Still(position[0], turned)
        renderer._trajectory = still
        image = cv2.cvtColor(renderer.render(0), cv2.COLOR_RGB2BGR)
        lidar = Lidar(seen.grid, still, seen.config.lidar, seen.config.seed * 100 + number)
        block = lidar.cast(number * 10**10, round(STAND_S * 200_000))
        kept = block.xyz_mm.any(axis=1) & ((block.tag & _GLUED) == 0)
        found.append(Stand(image, block.xyz_mm[kept] * 1e-3))
    return found


def guess(seed: int, degrees: float = 3.0, metres: float = 0.04) -> Extrinsics:
    """Measured by hand."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    return TRUE.moved(np.r_[np.radians(degrees) * axis / np.linalg.norm(axis), rng.uniform(-metres, metres, 3)])
