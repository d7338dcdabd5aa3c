"""Where the carrier goes: plane curves from the origin, as points a quarter metre apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.errors import SimulationError
from drivers.sim.scene import Doubles

STEP_M = 0.25
TURN_RADIUS_M = 1.4
LANE_M = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """points_m (n, 2), `STEP_M` apart along the curve, starting at the origin."""

    points_m: Doubles

    @property
    def length_m(self) -> float:
        """Length along the curve."""
        return float(np.linalg.norm(np.diff(self.points_m, axis=0), axis=1).sum())


def route(shape: str, length_m: float, seed: int) -> Route:
    """A route of the shape "loop" or "out_and_back". SimulationError for another."""
    rng = np.random.default_rng([seed, 11])
    if shape == "loop":
        return _loop(length_m, rng)
    if shape == "out_and_back":
        return _out_and_back(length_m, rng)
    raise SimulationError(f"path {shape!r}: expected loop or out_and_back")


def _loop(length_m: float, rng: np.random.Generator) -> Route:
    angle = np.linspace(0.0, 2.0 * np.pi, 20_000)
    radius = np.ones_like(angle)
    for harmonic, amplitude in ((2, 0.12), (3, 0.08), (5, 0.03 if length_m > 150 else 0.0)):
        radius += amplitude * rng.uniform(0.6, 1.0) * np.cos(harmonic * angle + rng.uniform(0.0, 2.0 * np.pi))
    curve = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    curve *= length_m / np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
    return Route(_even(curve - curve[0], STEP_M))


def _out_and_back(length_m: float, rng: np.random.Generator) -> Route:
    half = (length_m - np.pi * TURN_RADIUS_M) / 2.0
    along = np.arange(0.0, half, 0.05)
    heading = np.full_like(along, rng.uniform(0.0, 2.0 * np.pi))
    for wavelength in (190.0, 85.0, 40.0):
        heading += rng.uniform(0.2, 0.4) * np.sin(2.0 * np.pi * along / wavelength + rng.uniform(0.0, 2.0 * np.pi))
    tangent = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    left = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    out = np.cumsum(tangent, axis=0) * 0.05
    away = along[-1] - along
    lane = LANE_M + (2.0 * TURN_RADIUS_M - LANE_M) * np.exp(-((away / 6.0) ** 2))
    back = (out + lane[:, None] * left)[::-1]
    turn = np.linspace(-np.pi / 2.0, np.pi / 2.0, 60)[1:-1, None]
    bend = out[-1] + TURN_RADIUS_M * (left[-1] * (1.0 + np.sin(turn)) + tangent[-1] * np.cos(turn))
    curve = np.concatenate([out, bend, back])
    return Route(_even(curve - curve[0], STEP_M))


def _even(curve: Doubles, step_m: float) -> Doubles:
    """The same curve with points evenly spaced along it, both ends kept."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    even = np.linspace(0.0, along[-1], max(2, round(along[-1] / step_m) + 1))
    return np.stack([np.interp(even, along, curve[:, 0]), np.interp(even, along, curve[:, 1])], axis=1)
