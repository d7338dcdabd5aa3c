"""Carries the payload along a route: rest, walk with gait and turns, one stop on the way, rest for ever."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.sim.carriers import Carrier
from drivers.sim.paths import STEP_M, Route
from drivers.sim.scene import Doubles, Terrain
from drivers.sim.trajectory import SPLINE_NS, Trajectory

DT_S = SPLINE_NS * 1e-9
GRAVITY_M_S2 = 9.80665
SETTLE_S = 2.4
SPEED_SIGMA_S = 0.25
PATH_SIGMA_S = 0.15
GROUND_SIGMA_S = 0.30
HEADING_SIGMA_S = 0.50
ALIVE_SIGMA_S = 0.30
CLIMB_S = 4.0
HARMONICS = 14
REACH_SIGMAS = 3.0
HELD_S = 0.05
ROLL_S = 1.2


@dataclass(frozen=True, slots=True)
class Schedule:
    """How long the carrier stands at the start, at `stops` on the way and (at least, before the truth ends) at the end.

    roll_deg: by which the payload is rolled at every second stop, to the left and to the right in turn. calm: who stops
    does not look about.
    """

    rest_s: float = 10.0
    stop_s: float = 4.0
    end_s: float = 3.0
    stops: int = 1
    roll_deg: float = 0.0
    calm: bool = False


def walk(
    route: Route, terrain: Terrain, carrier: Carrier, schedule: Schedule, *, seed: int, shake: float = 1.0
) -> Trajectory:
    """The trajectory of `base_link`. shake scales hand shake and vibration."""
    rng = np.random.default_rng([seed, 51])
    along, stopped_s = _along(route, carrier, schedule, rng)
    xy, ground, heading = _follow(route, terrain, along)
    speed = np.gradient(along, DT_S)
    alive = _alive(schedule, stopped_s if schedule.calm else (), len(along))
    t: Doubles = DT_S * np.arange(len(along), dtype=np.float64)
    climb = carrier.climb_m * _climb(schedule, carrier, t)
    offset, turn = _gait(carrier, speed, t, rng)
    shaken, twisted = _shake(carrier, shake, speed, alive, t, rng=rng)
    offset, turn = offset + shaken, turn + twisted
    yaw_rate = np.gradient(heading, DT_S)
    turn[:, 0] += _rolled(schedule, stopped_s, t) - carrier.bank * np.arctan(speed * yaw_rate / GRAVITY_M_S2)
    turn[:, 1] += np.radians(carrier.mount_pitch_deg) + carrier.tilt * _smooth(np.gradient(speed, DT_S), 0.3)
    turn[:, 2] += heading + np.radians(carrier.gaze_deg) * alive * _noise(t, 0.03, 0.2, rng)
    ahead, left = offset[:, 0], offset[:, 1]
    x = xy[:, 0] + np.cos(heading) * ahead - np.sin(heading) * left
    y = xy[:, 1] + np.sin(heading) * ahead + np.cos(heading) * left
    return Trajectory(np.column_stack([x, y, ground + carrier.height_m + climb + offset[:, 2], turn]))


def _along(
    route: Route, carrier: Carrier, schedule: Schedule, rng: np.random.Generator
) -> tuple[Doubles, tuple[float, ...]]:
    """Distance along the route (m) at each knot of the spline, and when each stop begins (s)."""
    step = STEP_M / 5.0
    s: Doubles = np.arange(0.0, route.length_m, step, dtype=np.float64)
    curvature = np.abs(_curvature(route))
    limit = np.sqrt(carrier.sideways_m_s2 / np.maximum(curvature, 1e-3))
    wave = 1.0 + 0.06 * _noise(s, 0.02, 0.08, rng)
    fastest = np.minimum(carrier.speed_m_s * wave, np.interp(s, STEP_M * np.arange(len(limit)), limit))
    stops = [len(s) * k // (schedule.stops + 1) for k in range(1, schedule.stops + 1)]
    squared = fastest**2
    squared[[0, *stops, -1]] = 0.0
    gain = 2.0 * carrier.acceleration_m_s2 * step
    for k in range(1, len(s)):
        squared[k] = min(squared[k], squared[k - 1] + gain)
    for k in range(len(s) - 2, -1, -1):
        squared[k] = min(squared[k], squared[k + 1] + gain)
    speed = np.sqrt(squared)
    took = step / (0.5 * (speed[1:] + speed[:-1]))
    begin = schedule.rest_s + SETTLE_S + _airborne_s(carrier)
    when = begin + np.concatenate([[0.0], np.cumsum(took)])
    for stop in reversed(stops):
        when[stop + 1 :] += schedule.stop_s
        when = np.insert(when, stop + 1, when[stop] + schedule.stop_s)
        s = np.insert(s, stop + 1, s[stop])
    total = when[-1] + SETTLE_S + _airborne_s(carrier) + schedule.end_s
    along = _smooth(np.interp(DT_S * np.arange(int(total / DT_S) + 1), when, s), SPEED_SIGMA_S)
    return along, tuple(float(when[stop + k]) for k, stop in enumerate(stops))


def _rolled(schedule: Schedule, stopped_s: tuple[float, ...], t: Doubles) -> Doubles:
    """Roll (n,) in rad on top of the carrier's: eased in and out while it stands."""
    roll = np.zeros_like(t)
    for k, begin in enumerate(stopped_s[1::2]):
        inside = np.clip(np.minimum(t - begin, begin + schedule.stop_s - t) / ROLL_S, 0.0, 1.0)
        roll += (-1.0) ** k * np.radians(schedule.roll_deg) * inside**3 * (10.0 - 15.0 * inside + 6.0 * inside**2)
    return roll


def _follow(route: Route, terrain: Terrain, along: Doubles) -> tuple[Doubles, Doubles, Doubles]:
    """Place (n, 2), ground height and heading at each knot."""
    points = route.points_m
    s = STEP_M * np.arange(len(points)) * (route.length_m / (STEP_M * (len(points) - 1)))
    exact = np.stack([np.interp(along, s, points[:, 0]), np.interp(along, s, points[:, 1])], axis=1)
    xy = np.stack([_smooth(exact[:, 0], PATH_SIGMA_S), _smooth(exact[:, 1], PATH_SIGMA_S)], axis=1)
    tangent = np.gradient(points, axis=0)
    heading = np.interp(along, s, np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0])))
    return xy, _smooth(terrain.height_at(exact), GROUND_SIGMA_S), _smooth(heading, HEADING_SIGMA_S)


def _gait(carrier: Carrier, speed: Doubles, t: Doubles, rng: np.random.Generator) -> tuple[Doubles, Doubles]:
    """Offset (n, 3) ahead, left, up and rotation (n, 3) roll, pitch, yaw that come with the steps."""
    share = np.clip(speed / carrier.speed_m_s, 0.0, None)
    phase = 2.0 * np.pi * DT_S * np.cumsum(carrier.step_hz * np.sqrt(share))
    strength = np.minimum(share, 1.0) ** 2 * (1.0 + 0.2 * _noise(t, 0.1, 0.6, rng))
    offset = np.stack(
        [
            carrier.surge_m * np.sin(phase + 0.6),
            carrier.sway_m * np.sin(0.5 * phase),
            carrier.bob_m * (np.cos(phase) + 0.2 * np.cos(2.0 * phase + 0.8)),
        ],
        axis=1,
    )
    turn = np.radians(
        np.stack(
            [
                carrier.gait_roll_deg * np.sin(0.5 * phase + 0.9),
                carrier.gait_pitch_deg * np.cos(phase + 1.9),
                carrier.gait_yaw_deg * np.sin(0.5 * phase + 2.1),
            ],
            axis=1,
        )
    )
    return offset * strength[:, None], turn * strength[:, None]


def _shake(
    carrier: Carrier, scale: float, speed: Doubles, alive: Doubles, t: Doubles, *, rng: np.random.Generator
) -> tuple[Doubles, Doubles]:
    """Offset and rotation, (n, 3) each, of hand shake and of vibration."""
    moving = scale * alive * np.clip(speed / carrier.speed_m_s, 0.0, 1.0)
    if carrier.climb_m > 0.0:
        moving = scale * alive
    shake = np.stack([_noise(t, *carrier.shake_hz, rng) for _ in range(6)], axis=1) * (scale * alive)[:, None]
    hum = np.stack([_noise(t, *carrier.vibration_hz, rng) for _ in range(6)], axis=1) * moving[:, None]
    offset = carrier.shake_m * shake[:, :3] + carrier.vibration_m * hum[:, :3]
    turn = np.radians(carrier.shake_deg * shake[:, 3:] + carrier.vibration_deg * hum[:, 3:])
    return offset, turn


def _noise(x: Doubles, low: float, high: float, rng: np.random.Generator) -> Doubles:
    """Band-limited noise over x, peaks near one: random sines between two frequencies."""
    total = np.zeros_like(x)
    for frequency in rng.uniform(low, high, HARMONICS):
        total += np.sin(2.0 * np.pi * frequency * x + rng.uniform(0.0, 2.0 * np.pi))
    return total / (0.5 * HARMONICS)


def _airborne_s(carrier: Carrier) -> float:
    return CLIMB_S + SETTLE_S if carrier.climb_m > 0.0 else 0.0


def _climb(schedule: Schedule, carrier: Carrier, t: Doubles) -> Doubles:
    """Share of the flying height: up after the rest, down before the end."""
    if carrier.climb_m == 0.0:
        return np.zeros_like(t)
    up = np.clip((t - schedule.rest_s - HELD_S) / CLIMB_S, 0.0, 1.0)
    down = np.clip((t[-1] - schedule.end_s - t) / CLIMB_S, 0.0, 1.0)
    share = np.minimum(up, down)
    return np.asarray(share**3 * (10.0 - 15.0 * share + 6.0 * share**2))


def _alive(schedule: Schedule, stopped_s: tuple[float, ...], count: int) -> Doubles:
    """One between the two rests, zero in them and in the stops that begin then, smooth in between."""
    alive = np.ones(count)
    held_s = REACH_SIGMAS * ALIVE_SIGMA_S + HELD_S
    alive[: int((schedule.rest_s + held_s) / DT_S)] = 0.0
    alive[int(-(schedule.end_s + held_s) / DT_S) :] = 0.0
    for begin_s in stopped_s:
        alive[int(begin_s / DT_S) : int((begin_s + schedule.stop_s) / DT_S)] = 0.0
    return _smooth(alive, ALIVE_SIGMA_S)


def _curvature(route: Route) -> Doubles:
    tangent = np.gradient(route.points_m, STEP_M, axis=0)
    heading = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    return np.asarray(np.gradient(heading, STEP_M))


def _smooth(values: Doubles, sigma_s: float) -> Doubles:
    """Gaussian of finite reach, the ends held: what is constant stays exactly constant."""
    reach = int(REACH_SIGMAS * sigma_s / DT_S)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * DT_S / sigma_s) ** 2)
    kernel /= kernel.sum()
    return np.convolve(np.pad(values, reach, mode="edge"), kernel, mode="valid")
