"""Settings of the odometry. The defaults are for a Mid-360 in a forest; `docs/odometry.md` says what each gave."""

from __future__ import annotations

import math

import msgspec


class ImuConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Noise of the inertial sensor, as it is under motion: densities are a root hertz, walks a root second."""

    gyro_density_rad_s: float = 1.5e-4
    accel_density_m_s2: float = 3e-3
    gyro_walk_rad_s: float = 3e-5
    accel_walk_m_s2: float = 3e-4
    gyro_share: float = 3e-3
    """Error of scale and alignment, as a share of the rate."""
    accel_share: float = 3e-3
    """The same, as a share of the acceleration without gravity."""
    gyro_range_rad_s: float = math.radians(2000.0)
    accel_range_m_s2: float = 4.0 * 9.80665
    gyro_bias_limit_rad_s: float = 0.05
    accel_bias_limit_m_s2: float = 0.8
    longest_step_s: float = 0.05
    """A longer silence is a gap: the motion within it is unknown."""


class MapConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The voxel map: two grids, fine for stems, coarse for what is far and for recovery."""

    fine_m: float = 0.3
    coarse_m: float = 1.2
    voxels_most: int = 400_000
    frozen_points: int = 400
    """A voxel takes in this many points, then keeps its shape: the map does not follow the drift."""
    reach_m: float = 70.0
    """What is farther from the sensor is forgotten."""


class MatchConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Residuals of a scan against the map."""

    leaf_m: float = 0.2
    fewest_points: int = 6
    floor_m: float = 0.015
    """Error shared by all points of a cluster and its voxel: pose at insertion, deskewing, shape."""
    huber: float = 1.5
    gate: float = 6.0
    effective: float = 300.0
    """So many residuals a scan count as independent."""
    iterations: int = 4
    converged_rad: float = 1e-4
    converged_m: float = 5e-4


class OdometryConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All of it. lidar_in_base_m: origin of `livox_frame` in `base_link`, axes parallel."""

    lidar_in_base_m: tuple[float, float, float] = (-0.011, -0.02329, 0.04412)
    lidar_to_base: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    nearest_m: float = 0.5
    farthest_m: float = 70.0
    imu: ImuConfig = ImuConfig()
    map: MapConfig = MapConfig()
    match: MatchConfig = MatchConfig()
