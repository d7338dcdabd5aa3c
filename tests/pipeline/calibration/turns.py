"""A body that turns irregularly, as a gyroscope and a camera on it see it."""

import cv2
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from pipeline.calibration.image_turning import Picture
from pipeline.calibration.turning import Turning, of_gyro
from pipeline.camera import CameraModel

SECOND = 1_000_000_000
MOUNTED = Rotation.from_euler("zyx", [-88.0, 3.0, -91.0], degrees=True)
"""The camera in the body."""


class Turns:
    """Orientation of the body over time: Euler angles through random knots, radians."""

    def __init__(self, seed: int, seconds: float, size_rad: float = 0.25, knot_s: float = 0.35):
        at = np.arange(-2.0, seconds + 2.0, knot_s)
        self._angles = CubicSpline(at, np.random.default_rng(seed).normal(0.0, size_rad, (len(at), 3)))
        self.seconds = seconds

    def orientation(self, at_s) -> Rotation:
        return Rotation.from_euler("zyx", self._angles(at_s))

    def gyro(self, noise_rad_s: float = 0.003, bias_rad_s: float = 0.01) -> Turning:
        """200 Hz, from one second before to one after."""
        at = np.arange(-1.0, self.seconds + 1.0, 0.005)
        step = 1e-4
        rate = (self.orientation(at - step).inv() * self.orientation(at + step)).as_rotvec() / (2.0 * step)
        noise = np.random.default_rng(5).normal(0.0, noise_rad_s, rate.shape)
        return of_gyro(np.round(at * SECOND).astype(np.int64), rate + bias_rad_s + noise)

    def camera(self, late_s: float, noise_rad_s: float = 0.01, drift: float = 0.0, hz: float = 29.97) -> Turning:
        """Stamped late, in the axes of the camera."""
        at = np.arange(0.0, self.seconds, 1.0 / hz)
        looks = self.orientation(at) * MOUNTED
        rate = (looks[:-1].inv() * looks[1:]).as_rotvec() * hz
        rate = rate + np.random.default_rng(6).normal(0.0, noise_rad_s, rate.shape)
        stamps = np.round((at * (1.0 + drift) + late_s) * SECOND).astype(np.int64)
        return Turning(stamps[:-1], stamps[1:], rate)

    def pictures(self, camera: CameraModel, hz: float = 20.0, late_s: float = 0.0):
        """Of a far wall all around."""
        noise = np.random.default_rng(7).uniform(0, 255, (64, 128))
        wall = cv2.resize(noise, (2048, 1024), interpolation=cv2.INTER_CUBIC).clip(0, 255).astype(np.uint8)
        rows, columns = np.mgrid[: camera.height_px, : camera.width_px]
        rays = camera.rays(np.column_stack([columns.ravel(), rows.ravel()]).astype(float))
        for at_s in np.arange(0.0, self.seconds, 1.0 / hz):
            x, y, z = (self.orientation(at_s) * MOUNTED).apply(rays).T
            across = (np.arctan2(y, x) / np.pi + 1.0) * 1024.0
            down = (np.arcsin(z) / np.pi + 0.5) * 1024.0
            shape = (camera.height_px, camera.width_px)
            grey = cv2.remap(wall, across.reshape(shape).astype(np.float32), down.reshape(shape).astype(np.float32), 1)
            yield Picture(round((at_s + late_s) * SECOND), grey)
