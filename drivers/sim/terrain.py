"""Ground of the simulated forest: hills of several sizes, a slope, hummocks; how far each spot is from the route."""

from __future__ import annotations

import numpy as np

from drivers.sim.paths import Route
from drivers.sim.scene import Doubles, Floats, Terrain

CELL_M = 1.0
NEAR_M = 4.0
FAR_STRIDE = 8
OCTAVES_M = ((90.0, 3.0), (35.0, 0.8), (12.0, 0.22), (4.0, 0.06))


def shape(route: Route, margin_m: float, relief: float, slope: float, seed: int) -> Terrain:
    """Terrain over the route and `margin_m` around, 0 at the start. relief scales the hills, slope is rise over run."""
    low = np.floor(route.points_m.min(axis=0) - margin_m)
    high = np.ceil(route.points_m.max(axis=0) + margin_m)
    columns, rows = (int(count) + 1 for count in (high - low) / CELL_M)
    x, y = low[0] + CELL_M * np.arange(columns), low[1] + CELL_M * np.arange(rows)
    rng = np.random.default_rng([seed, 21])
    bearing = rng.uniform(0.0, 2.0 * np.pi)
    height = slope * (np.cos(bearing) * x[None, :] + np.sin(bearing) * y[:, None])
    for wavelength_m, amplitude_m in OCTAVES_M:
        height = height + relief * amplitude_m * _waves(x, y, wavelength_m, rng)
    height += rng.normal(0.0, 0.012, height.shape)
    ground = Terrain((float(low[0]), float(low[1])), CELL_M, height.astype(np.float32))
    start = float(ground.height_at(route.points_m[:1])[0])
    return Terrain(ground.origin_m, CELL_M, (height - start).astype(np.float32))


def _waves(x: Doubles, y: Doubles, wavelength_m: float, rng: np.random.Generator) -> Doubles:
    """Plane waves in random directions: a smooth random field of about unit variance."""
    field = np.zeros((len(y), len(x)))
    count = 6
    for bearing in rng.uniform(0.0, 2.0 * np.pi, count):
        k = 2.0 * np.pi / (wavelength_m * rng.uniform(0.75, 1.35))
        east = np.exp(1j * k * np.cos(bearing) * x + 1j * rng.uniform(0.0, 2.0 * np.pi))
        north = np.exp(1j * k * np.sin(bearing) * y)
        field += np.real(north[:, None] * east[None, :])
    return np.asarray(field * np.sqrt(2.0 / count))


def distance_to(route: Route, terrain: Terrain, reach_m: float) -> Floats:
    """Distance (m) of each corner of the terrain to the route, `reach_m` at most."""
    distance = np.full(terrain.height_m.shape, reach_m, dtype=np.float32)
    for point in route.points_m[::FAR_STRIDE]:
        _stamp(distance, terrain, point, reach_m)
    for point in route.points_m:
        _stamp(distance, terrain, point, NEAR_M)
    return distance


def _stamp(distance: Floats, terrain: Terrain, point: Doubles, reach_m: float) -> None:
    rows, columns = distance.shape
    u, v = (point - np.asarray(terrain.origin_m)) / CELL_M
    reach = int(reach_m / CELL_M) + 1
    i0, i1 = max(0, int(u) - reach), min(columns, int(u) + reach + 2)
    j0, j1 = max(0, int(v) - reach), min(rows, int(v) + reach + 2)
    from_point = CELL_M * np.hypot(np.arange(i0, i1)[None, :] - u, np.arange(j0, j1)[:, None] - v)
    window = distance[j0:j1, i0:i1]
    np.minimum(window, from_point, out=window, casting="same_kind")
