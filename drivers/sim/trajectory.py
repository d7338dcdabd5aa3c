"""The true motion: a quintic B-spline in time, so that velocity, acceleration and rates are its exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.sim.scene import Doubles
from drivers.sim.spline_kernels import evaluate

SPLINE_NS = 5_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """`base_link` in the world (ENU) at n times: position, velocity, acceleration (n, 3).

    rotation: (n, 3, 3) body to world. angular_velocity: (n, 3) in the body frame, rad/s.
    """

    position_m: Doubles
    velocity_m_s: Doubles
    acceleration_m_s2: Doubles
    rotation: Doubles
    angular_velocity: Doubles


class Trajectory:
    """Pose and derivatives at any walk time; still before the start and after the end. Thread-safe."""

    def __init__(self, control: Doubles) -> None:
        """control: (n, 6) x, y, z (m), roll, pitch, yaw (rad, R = Rz Ry Rx, unwrapped), `SPLINE_NS` apart."""
        self._control = np.ascontiguousarray(control)

    @property
    def duration_ns(self) -> int:
        """Walk time from which on everything is still."""
        return (len(self._control) - 1) * SPLINE_NS

    def at(self, t_ns: npt.ArrayLike) -> Motion:
        """Motion at times of any shape, flattened to (n,)."""
        value, rate, second = np.moveaxis(self.spline(t_ns), 1, 0)
        turn, turn_rate = value[:, 3:], rate[:, 3:]
        return Motion(value[:, :3], rate[:, :3], second[:, :3], _rotation(turn), _body_rate(turn, turn_rate))

    def poses(self, t_ns: npt.ArrayLike) -> tuple[Doubles, Doubles]:
        """Position (n, 3) and rotation (n, 3, 3) only."""
        value = self.spline(t_ns)[:, 0]
        return value[:, :3], _rotation(value[:, 3:])

    def position(self, t_ns: int, lever_m: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Doubles:
        """ENU position (3,) of a point fixed at `lever_m` in `base_link`."""
        position, rotation = self.poses(t_ns)
        return np.asarray(position[0] + rotation[0] @ np.asarray(lever_m, dtype=np.float64))

    def velocity(self, t_ns: int, lever_m: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Doubles:
        """ENU velocity (3,) of a point fixed at `lever_m` in `base_link`."""
        motion = self.at(t_ns)
        swing = np.cross(motion.angular_velocity[0], np.asarray(lever_m, dtype=np.float64))
        return np.asarray(motion.velocity_m_s[0] + motion.rotation[0] @ swing)

    def quaternions(self, t_ns: npt.ArrayLike) -> Doubles:
        """Rotation body to world as x, y, z, w (n, 4)."""
        value = self.spline(t_ns)[:, 0]
        half = 0.5 * value[:, 3:]
        (cr, cp, cy), (sr, sp, sy) = np.cos(half).T, np.sin(half).T
        return np.stack(
            [
                sr * cp * cy - cr * sp * sy,
                cr * sp * cy + sr * cp * sy,
                cr * cp * sy - sr * sp * cy,
                cr * cp * cy + sr * sp * sy,
            ],
            axis=1,
        )

    def spline(self, t_ns: npt.ArrayLike) -> Doubles:
        """(n, 3, 6): x, y, z, roll, pitch, yaw; their rates; their second derivatives."""
        return np.asarray(evaluate(self._control, np.asarray(t_ns, dtype=np.int64).ravel(), SPLINE_NS))


def _rotation(turn: Doubles) -> Doubles:
    (cr, cp, cy), (sr, sp, sy) = np.cos(turn).T, np.sin(turn).T
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _body_rate(turn: Doubles, rate: Doubles) -> Doubles:
    (cr, cp, _), (sr, sp, _) = np.cos(turn).T, np.sin(turn).T
    roll, pitch, yaw = rate.T
    return np.stack([roll - yaw * sp, pitch * cr + yaw * cp * sr, yaw * cp * cr - pitch * sr], axis=1)
