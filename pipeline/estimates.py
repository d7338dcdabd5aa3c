"""What odometry and GNSS fusion estimate. Frames: `map` (ENU at the datum) -> `odom` -> `base_link`.

Stamps are nanoseconds in the time of the messages that came in (host or session time).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class OdometryEstimate:
    """`base_link` in `odom` at the end of a scan. It never jumps.

    position_m, velocity_m_s: (3,) in `odom`. rotation: (3, 3).
    covariance: (6, 6) of position (m, `odom`), then rotation (rad, right perturbation: the body's frame).
    gyro_bias (rad/s), accel_bias (m/s^2): (3,) in `base_link`.
    travelled_m: length of the way since the start. weak_directions: (k, 3), k = 0 unless degenerate.
    points: points used; matches: of them, those that met the map. note: empty, or what is wrong in words.
    """

    stamp_ns: int
    position_m: Array
    rotation: Array
    velocity_m_s: Array
    covariance: Array
    gyro_bias: Array
    accel_bias: Array
    travelled_m: float
    degenerate: bool
    weak_directions: Array
    points: int
    matches: int
    note: str = ""


@dataclass(frozen=True, slots=True)
class MapToOdom:
    """`odom` in `map`: p_map = Rz(yaw_rad) @ p_odom + translation_m.

    covariance: (4, 4) of x, y, z (m), yaw (rad), at `stamp_ns`. datum: latitude and longitude (degrees) and
    ellipsoidal height (m) of the origin of `map`, None before the first good fix. observable: the yaw is known.
    """

    stamp_ns: int
    translation_m: Array
    yaw_rad: float
    covariance: Array
    datum: tuple[float, float, float] | None
    fixes_used: int
    fixes_rejected: int
    observable: bool


@dataclass(frozen=True, slots=True)
class GlobalPose:
    """`base_link` in `map` (ENU at the datum).

    position_enu_m: (3,). rotation: (3, 3). covariance: (6, 6) of position (m, ENU), then rotation (rad, body's frame).
    """

    stamp_ns: int
    position_enu_m: Array
    rotation: Array
    covariance: Array
