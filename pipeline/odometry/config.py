"""Settings of the odometry. The defaults are for a Mid-360 in a forest; `docs/odometry.md` has what they reach."""

from __future__ import annotations

import math

import msgspec


class ImuConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Noise of the inertial sensor, as it is under motion: densities are a root hertz, walks a root second."""

    gyro_density_rad_s: float = 1.5e-4
    accel_density_m_s2: float = 3e-3
    joined_s: float = 10.0
    joined_accel_density_m_s2: float = 2e-2
    """After a start on the way, for `joined_s`: the map was laid down before the vertical was known, and is warped in a
    way that lasts and looks like a push."""
    gyro_walk_rad_s: float = 1e-4
    """Five times that of a sensor at rest: errors of scale and alignment come and go with the turns, as a bias does."""
    accel_walk_m_s2: float = 3e-4
    gravity_walk_rad: float = 5e-5
    """A root second. The map tilts a little as it is laid down; held still, gravity would put that on the
    accelerometer's bias, and the way would climb by it until the next turn."""
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
    """The voxel map: a fine grid for stems, a coarse one for what is far and for recovery."""

    sizes_m: tuple[float, ...] = (0.3, 1.2)
    """Of the voxels of each grid, fine to coarse."""
    sides: int = 4
    """4: what is seen from another side is another voxel (`map_kernels.side`); 1: one voxel from all sides."""
    voxels_most: int = 700_000
    """90 MB, and 34 MB of hash table. A full map shortens its reach: from a bicycle the way then drifts more."""
    frozen_points: int = 100
    """A voxel takes in this many points, then keeps its shape: the map does not follow the drift."""
    reach_m: float = 70.0
    """What is farther from the sensor is forgotten."""


class MatchConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Residuals of a scan against the map."""

    leaf_m: float = 0.3
    most: int = 2500
    """So many clusters of a scan are matched; all are put into the map."""
    fewest_points: int = 6
    floor_m: float = 0.015
    """Error shared by all points of a cluster and its voxel: pose at insertion, deskewing, shape."""
    huber: float = 1.5
    gate: float = 6.0
    wide: float = 0.025
    """Variance, as a share of the squared voxel size, from which on a direction is the voxel's own and says nothing."""
    prior: float = 0.0278
    """Variance, likewise, that a voxel of few points is taken to have, with the weight of `prior_points`."""
    prior_points: float = 3.0
    directions: int = 1
    """So many of a voxel's directions are used, the thinnest first. 1: point to plane, the plane with a thickness; with
    the others the drift is a third more, since along a surface the middle of what was seen is no place on the tree."""
    settled_scans: float = 200.0
    """A voxel was laid down with the error that the pose had, so what is new only repeats the drift since the old. Its
    residual counts by its age, up to this; the residuals of a scan together count `effective` all the same."""
    fresh_share: float = 0.05
    """Of a voxel that has just been laid down."""
    round_m: float = 0.028
    """The middle of what is seen of a stem lies off its own by this, towards the sensor; from elsewhere it lies deeper,
    by this times 1 - cos of the turn: by 5, 12 and 23 mm in the mean where the view has turned by 37, 52 and 75 deg."""
    effective: float = 150.0
    """So many residuals a scan count as independent."""
    least_share: float = 0.15
    """Share of clusters that must meet a voxel, or the scan does not fit."""
    wide_start_m: float = 0.15
    """With a prior wider than this the first `coarse_rounds` use the coarse grid alone."""
    coarse_rounds: int = 5
    iterations: int = 4
    converged_rad: float = 1e-4
    converged_m: float = 5e-4


class DegeneracyConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A direction is weak when the scan alone would leave it this uncertain; little of it is used then.

    Over a level field, where nothing shows the way, chance alone gives 4.0 cm; in forests the worst direction of the
    worst scan has 2.8, from a UAV.
    """

    attitude_rad: float = 0.014
    position_m: float = 0.034
    share_left: float = 0.03


class DriftConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the map's own error grows with the way: shares of it, measured against the simulator's truth."""

    yaw_deg_per_root_m: float = 0.004
    horizontal: float = 0.0015
    vertical: float = 0.001
    """On top of what the tilt lifts."""
    correlated_m: float = 50.0
    tilt_lasts_m: float = 500.0
    weak: float = 0.3
    """Share of the way that may be wrong along a direction that the scans do not show."""


class StartConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Start-up, at rest or in motion."""

    window_s: float = 1.0
    rest_gyro_rad_s: float = 0.02
    """Standard deviation of the rate, and largest mean rate over twice that, of a payload at rest."""
    rest_accel_m_s2: float = 0.15
    moving_scans: int = 10
    passes: int = 4
    velocity_sigma_m_s: float = 0.5
    """A start in motion is refused while the velocity is less certain than this."""


class FaultConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """When to give up the state and start again."""

    imu_gap_s: float = 0.15
    """After a longer silence of scans and inertial sensor the scan must fit the map as those before it."""
    lost_m: float = 2.0
    """Position against the map less certain than this."""
    misfits: int = 20
    """Scans in a row that do not fit the map, with a position less certain than `coasting_m`."""
    coasting_m: float = 0.3
    misfits_most: int = 100
    """The same, however certain the inertial samples alone make it."""
    fastest_m_s: float = 60.0


class OdometryConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All of it. lidar_in_base_m: origin of `livox_frame` in `base_link`, axes parallel."""

    lidar_in_base_m: tuple[float, float, float] = (-0.011, -0.02329, 0.04412)
    lidar_to_base: tuple[tuple[float, float, float], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    nearest_m: float = 0.5
    farthest_m: float = 70.0
    points_most: int = 24_000
    """More points than this are thinned evenly in time: a slower machine sets less."""
    imu: ImuConfig = ImuConfig()
    map: MapConfig = MapConfig()
    match: MatchConfig = MatchConfig()
    degeneracy: DegeneracyConfig = DegeneracyConfig()
    drift: DriftConfig = DriftConfig()
    start: StartConfig = StartConfig()
    fault: FaultConfig = FaultConfig()
