"""Where trees stand, how thick they are and how tall: the inventory of the forest before it has leaves."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import numpy.typing as npt

from drivers.sim.forest_config import ForestConfig
from drivers.sim.paths import STEP_M, Route
from drivers.sim.scene import Doubles, Floats, Terrain, Trees
from drivers.sim.species import TRAITS, Species

CLEARANCE_M = 1.3
SUCKER_SPREAD_M = 2.2
SUCKER_SPACING_M = 0.5
SMALLEST_DBH_M = 0.03
MATURE_DBH_M = 0.12
BREAST_M = 1.3


def plant(config: ForestConfig, route: Route, terrain: Terrain, distance: Floats) -> Trees:
    """The inventory: clones of Tree-of-Heaven near the route first, then everything else around them."""
    rng = np.random.default_rng([config.seed, 31])
    clone_xy, clone_dbh, clone = _clones(config, route, rng)
    clear = np.flatnonzero(terrain.sample(distance, clone_xy) > CLEARANCE_M + clone_dbh)
    clear = clear[apart(clone_xy[clear], np.empty((0, 2)), SUCKER_SPACING_M)]
    clone_xy, clone_dbh, clone = clone_xy[clear], clone_dbh[clear], clone[clear]
    xy = _rows(config, terrain, rng) if config.row_m else _scattered(config, terrain, distance, rng)
    xy = xy[apart(xy, clone_xy, min(config.spacing_m, 1.5))]
    xy = xy[_standing(config, terrain, distance, xy, rng)]
    dbh = SMALLEST_DBH_M + config.dbh_scale_m * rng.weibull(config.dbh_shape, len(xy))
    names = np.array(list(config.mix), dtype=np.uint8)
    shares = np.array(list(config.mix.values()))
    species = rng.choice(names, len(xy), p=shares / shares.sum())
    return _inventory(
        config,
        terrain,
        np.concatenate([clone_xy, xy]),
        species=np.concatenate([np.full(len(clone_xy), Species.TREE_OF_HEAVEN, np.uint8), species]),
        dbh=np.concatenate([clone_dbh, dbh]),
        clone=np.concatenate([clone, np.full(len(xy), -1, np.int32)]),
        rng=rng,
    )


def _clones(
    config: ForestConfig, route: Route, rng: np.random.Generator
) -> tuple[Doubles, Doubles, npt.NDArray[np.int32]]:
    """Mother trees beside the route, each with her root suckers."""
    every = 100.0 / max(config.clones_per_100m, 0.01)
    xy: list[Doubles] = [np.empty((0, 2))]
    dbh: list[Doubles] = [np.empty(0)]
    clone: list[npt.NDArray[np.int32]] = [np.empty(0, np.int32)]
    for number, spot in enumerate(np.arange(9.0, route.length_m - 3.0, every)):
        k = min(int((spot + rng.uniform(-4.0, 4.0)) / STEP_M), len(route.points_m) - 2)
        ahead = route.points_m[k + 1] - route.points_m[k]
        left = np.array([-ahead[1], ahead[0]]) / np.linalg.norm(ahead)
        mother = route.points_m[k] + left * rng.choice([-1.0, 1.0]) * rng.uniform(2.4, 6.0)
        suckers = int(rng.integers(3, 10))
        xy.append(np.vstack([mother, mother + rng.normal(0.0, SUCKER_SPREAD_M, (suckers, 2))]))
        dbh.append(np.concatenate([rng.uniform(0.14, 0.34, 1), rng.uniform(SMALLEST_DBH_M, 0.08, suckers)]))
        clone.append(np.full(suckers + 1, number, np.int32))
    return np.concatenate(xy), np.concatenate(dbh), np.concatenate(clone)


def _scattered(config: ForestConfig, terrain: Terrain, distance: Floats, rng: np.random.Generator) -> Doubles:
    """Darts of a hard-core process: those too near to an earlier one are left out."""
    rows, columns = terrain.height_m.shape
    size = np.array([columns - 1, rows - 1]) * terrain.cell_m
    wanted = int(config.stems_per_ha * size[0] * size[1] / 10_000.0)
    darts = rng.uniform(0.0, 1.0, (2 * wanted, 2)) * size + np.asarray(terrain.origin_m)
    near = terrain.sample(distance, darts) < config.corridor_m
    darts = darts[near]
    return np.asarray(darts[apart(darts, np.empty((0, 2)), config.spacing_m)[: int(wanted * near.mean())]])


def apart(darts: Doubles, taken: Doubles, spacing_m: float) -> npt.NDArray[np.int64]:
    """Indices of those darts, in order, that keep `spacing_m` from `taken` and from each other."""
    grid: defaultdict[tuple[int, int], list[tuple[float, float]]] = defaultdict(list)
    for x, y in taken.tolist():
        grid[int(x // spacing_m), int(y // spacing_m)].append((x, y))
    kept = []
    for index, (x, y) in enumerate(darts.tolist()):
        i, j = int(x // spacing_m), int(y // spacing_m)
        neighbours = (other for di in (-1, 0, 1) for dj in (-1, 0, 1) for other in grid.get((i + di, j + dj), ()))
        if all((x - a) ** 2 + (y - b) ** 2 >= spacing_m**2 for a, b in neighbours):
            grid[i, j].append((x, y))
            kept.append(index)
    return np.array(kept, dtype=np.int64)


def _rows(config: ForestConfig, terrain: Terrain, rng: np.random.Generator) -> Doubles:
    """A plantation: straight rows, few gaps, small errors of the planter."""
    rows, columns = terrain.height_m.shape
    half = 0.75 * max(rows, columns) * terrain.cell_m
    across, along = np.meshgrid(np.arange(-half, half, config.row_m), np.arange(-half, half, config.spacing_m))
    bearing = rng.uniform(0.0, np.pi)
    turn = np.array([[np.cos(bearing), -np.sin(bearing)], [np.sin(bearing), np.cos(bearing)]])
    centre = np.asarray(terrain.origin_m) + 0.5 * terrain.cell_m * np.array([columns, rows])
    spots = np.stack([across.ravel(), along.ravel()], axis=1) @ turn.T + centre
    spots = spots[rng.random(len(spots)) > 0.08]
    return np.asarray(spots + rng.normal(0.0, 0.12, spots.shape))


def _standing(
    config: ForestConfig, terrain: Terrain, distance: Floats, xy: Doubles, rng: np.random.Generator
) -> npt.NDArray[np.bool_]:
    """Off the route, inside the corridor, and on the wooded side of a meadow's edge."""
    from_route = terrain.sample(distance, xy)
    keep = (from_route > config.clearance_m) & (from_route < config.corridor_m)
    if config.meadow:
        edge = 3.0 * np.sin(xy[:, 0] / 9.0 + rng.uniform(0.0, 6.0)) - 1.0
        keep &= (xy[:, 1] > edge) | (rng.random(len(xy)) < 0.02)
    return np.asarray(keep)


def _inventory(
    config: ForestConfig,
    terrain: Terrain,
    xy: Doubles,
    *,
    species: npt.NDArray[np.uint8],
    dbh: Doubles,
    clone: npt.NDArray[np.int32],
    rng: np.random.Generator,
) -> Trees:
    ceiling = np.array([traits.ceiling_m for traits in TRAITS])[species]
    growth = np.array([traits.growth_per_m for traits in TRAITS])[species]
    start = np.array([traits.crown_start for traits in TRAITS])[species]
    spread = np.array([traits.crown_per_dbh for traits in TRAITS])[species]
    spread_at_first = 0.45
    dbh = np.minimum(dbh, np.where(species == Species.SUMAC, 0.10, 0.95))
    young = np.minimum(dbh / MATURE_DBH_M, 1.0) ** 0.7
    height = BREAST_M + 0.8 + ceiling * (1.0 - np.exp(-growth * dbh)) * young * rng.uniform(0.85, 1.15, len(dbh))
    lean = np.tan(np.abs(rng.normal(0.0, config.lean_deg, len(dbh))) * np.pi / 180.0)
    bearing = rng.uniform(0.0, 2.0 * np.pi, len(dbh))
    return Trees(
        position_m=np.column_stack([xy, terrain.height_at(xy)]),
        species=species,
        dbh_m=dbh,
        height_m=height,
        crown_base_m=height * start * rng.uniform(0.8, 1.15, len(dbh)),
        crown_radius_m=np.minimum(spread_at_first + spread * dbh, 5.5) * rng.uniform(0.8, 1.2, len(dbh)),
        lean=np.stack([lean * np.cos(bearing), lean * np.sin(bearing)], axis=1),
        clone=clone,
        taped=(rng.random(len(dbh)) < config.taped_share) & (dbh > 0.08),
    )
