"""The first state: at rest from gravity and the gyro's mean, in motion from the first scans against each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drivers.messages import LidarScan
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.deskew_kernels import deskew
from pipeline.odometry.drift import level
from pipeline.odometry.errors import TRIED, StartRefused
from pipeline.odometry.filter import Filter
from pipeline.odometry.rough_velocity import rough_velocity
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.state import ERRORS, GRAVITY_M_S2, VELOCITY, State
from pipeline.odometry.tracker import Registration, Tracker, usable

FORCE_SHARE = (0.8, 1.2)
"""Mean specific force at start-up, as a share of gravity; beyond it the unit is wrong, or the payload falls."""
SIGMAS = {"attitude": 1e-4, "position": 1e-4, "velocity": 0.01, "gyro": 3e-4, "accel": 0.1, "gravity": 0.012}
MOVING = SIGMAS | {"velocity": 1.0, "gyro": 6e-3, "gravity": 0.15}


def force_scale(imu: Doubles) -> float:
    """What the readings (m, 7) must be multiplied with to be m/s^2: 1, or 9.80665 for a driver that gives g.

    StartRefused when neither gives gravity.
    """
    size = float(np.linalg.norm(imu[:, 4:7].mean(axis=0)))
    for scale in (1.0, GRAVITY_M_S2):
        if FORCE_SHARE[0] < size * scale / GRAVITY_M_S2 < FORCE_SHARE[1]:
            return scale
    raise StartRefused(
        f"the accelerometer shows {size:.2f} on average, neither about 9.8 (m/s^2) nor 1 (g): "
        "check its unit and scale; hold the payload still if it falls or swings"
    )


def is_at_rest(imu: Doubles, config: OdometryConfig) -> bool:
    """Whether nothing moves in a window (m, 7) in SI units."""
    start = config.start
    rate, force = imu[:, 1:4], imu[:, 4:7]
    quiet = rate.std(axis=0).max() < start.rest_gyro_rad_s and force.std(axis=0).max() < start.rest_accel_m_s2
    return bool(quiet and np.abs(rate.mean(axis=0)).max() < 0.5 * start.rest_gyro_rad_s)


def start_at_rest(imu: Doubles, config: OdometryConfig) -> Filter:
    """From a window (m, 7) at rest: `odom` is level and heads where the payload does.

    An accelerometer bias cannot be told from tilt yet: it goes to gravity, wide open, and is found under way.
    """
    state = _upright(imu[:, 4:7].mean(axis=0), gyro_bias=imu[:, 1:4].mean(axis=0))
    return Filter(state, _covariance(SIGMAS), config.imu, config.match)


def start_in_motion(scans: list[LidarScan], windows: list[Doubles], config: OdometryConfig) -> Filter:
    """The state at the start of the first of some consecutive scans; windows: the samples (m, 7) of each.

    Passes over the same scans: each begins with the velocity and gravity that the one before ended up with, so that the
    first scan is deskewed ever better. StartRefused when they do not agree with each other, with the reason.
    """
    force = np.concatenate([window[:, 4:7] for window in windows]).mean(axis=0)
    state = _upright(force, gyro_bias=np.zeros(3))
    clouds, times_s = _clouds(scans, windows, state, config)
    state = replace(state, velocity_m_s=rough_velocity(clouds, times_s))
    moved, matched, tracker, found = 0.0, 1.0, None, None
    for _ in range(config.start.passes):
        tracker = Tracker(config, Filter(state, _covariance(MOVING), config.imu, config.match, joined=True))
        pushed, shares = np.zeros(3), []
        for scan, window in zip(scans, windows, strict=True):
            before = tracker.filter.state
            found = tracker.track(scan, window)
            shares.append(found.residuals.matches / max(found.residuals.clusters, 1))
            pushed += _pushed(before, window, config)
        end = tracker.filter.state
        took_s = sum(float(window[-1, 0] - window[0, 0]) for window in windows)
        velocity = end.velocity_m_s - pushed - took_s * end.gravity_m_s2
        upright = level(end.gravity_m_s2)
        again = State(
            upright @ state.rotation,
            np.zeros(3),
            upright @ velocity,
            end.gyro_bias,
            state.accel_bias,
            state.gravity_m_s2,
        )
        moved, matched = float(np.linalg.norm(again.velocity_m_s - state.velocity_m_s)), float(np.mean(shares[1:]))
        state = again
    assert tracker is not None
    assert found is not None
    _accept(tracker, found, moved, matched, config)
    sigmas = MOVING | {"velocity": 0.3, "gravity": 0.03, "gyro": 3e-3}
    return Filter(state, _covariance(sigmas), config.imu, config.match, joined=True)


def _clouds(
    scans: list[LidarScan], windows: list[Doubles], state: State, config: OdometryConfig
) -> tuple[list[Doubles], Doubles]:
    """The scans turned to `odom` by the gyro alone, as if from one place, and their middle times (s)."""
    clouds = []
    for scan, window in zip(scans, windows, strict=True):
        probe = Filter(replace(state, velocity_m_s=np.zeros(3)), np.eye(ERRORS), config.imu, config.match)
        weightless = window.copy()
        weightless[:, 4:7] = 0.0
        knots = probe.propagate(weightless)
        knots[:, 10:19] = 0.0
        keep = usable(scan, config)
        turn, lever = np.array(config.lidar_to_base), np.array(config.lidar_in_base_m)
        points = deskew(scan.xyz_m[keep], scan.offset_ns[keep] * 1e-9, knots, turn, lever)
        state = replace(state, rotation=probe.state.rotation)
        clouds.append(points @ state.rotation.T)
    return clouds, np.array([scan.stamp_ns - scans[0].stamp_ns for scan in scans]) * 1e-9


def _accept(tracker: Tracker, last: Registration, moved: float, matched: float, config: OdometryConfig) -> None:
    sigma = float(np.sqrt(np.diag(tracker.filter.covariance)[VELOCITY].max()))
    limit = config.start.velocity_sigma_m_s
    if matched < config.match.least_share:
        raise StartRefused(
            f"only {matched:.0%} of a scan meets the scans before it: nothing solid in view, or moving too fast",
            TRIED,
        )
    if len(last.weak_position) > 1:
        raise StartRefused("the scans do not show which way they went: hold still, or move among trees", TRIED)
    if sigma > limit or moved > limit:
        raise StartRefused(
            f"the velocity is not clear yet (sigma {sigma:.2f} m/s, still changing by {moved:.2f} m/s): "
            "hold still, or move where there is more than open ground in view",
            TRIED,
        )


def _upright(force: Doubles, gyro_bias: Doubles) -> State:
    down = np.array([0.0, 0.0, -GRAVITY_M_S2])
    rotation = level(-force)
    heading = np.arctan2(rotation[1, 0], rotation[0, 0])
    c, s = np.cos(-heading), np.sin(-heading)
    ahead = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return State(ahead @ rotation, np.zeros(3), np.zeros(3), gyro_bias, np.zeros(3), down)


def _covariance(sigmas: dict[str, float]) -> Doubles:
    order = ("attitude", "position", "velocity", "gyro", "accel")
    spread = np.concatenate([*(np.full(3, sigmas[name]) for name in order), np.full(2, sigmas["gravity"])])
    return np.diag(spread**2)


def _pushed(before: State, window: Doubles, config: OdometryConfig) -> Doubles:
    """Velocity (3,) in `odom` that the specific force alone, without gravity, gives over a window."""
    probe = Filter(before, np.eye(ERRORS), config.imu, config.match)
    probe.propagate(window)
    took_s = float(window[-1, 0] - window[0, 0])
    return probe.state.velocity_m_s - before.velocity_m_s - took_s * before.gravity_m_s2
