"""What grows and lies between the trees: shrubs, grass, dead wood."""

from __future__ import annotations

import numpy as np

from drivers.sim.crowns import clumps
from drivers.sim.forest_config import ForestConfig
from drivers.sim.scene import Branches, Doubles, Floats, Foliage, Kind, Terrain
from drivers.sim.species import Species

LOG_M = (2.0, 7.0)


def shrubs(config: ForestConfig, terrain: Terrain, distance: Floats, rng: np.random.Generator) -> Foliage:
    """Each shrub is three clumps around its middle."""
    middle = _between(config.shrubs_per_ha, config, terrain, distance, beside_m=0.6, rng=rng)
    size = rng.uniform(0.25, 0.7, len(middle))
    parts = np.repeat(np.arange(len(middle)), 3)
    offset = rng.normal(0.0, 0.6, (len(parts), 2)) * size[parts, None]
    xy = middle[parts] + offset
    lift = size[parts] * rng.uniform(0.6, 1.8, len(parts))
    semi_axes = np.stack([size, 0.8 * size], axis=1)[parts]
    return _clumps(terrain, xy, lift, semi_axes=semi_axes, species=Species.SHRUB, rng=rng)


def grass(config: ForestConfig, terrain: Terrain, distance: Floats, rng: np.random.Generator) -> Foliage:
    """Low tufts, half sunk into the ground."""
    xy = _between(config.grass_per_ha, config, terrain, distance, beside_m=0.0, rng=rng)
    width, height = rng.uniform(0.2, 0.6, len(xy)), rng.uniform(0.1, 0.4, len(xy))
    semi_axes = np.stack([width, height], axis=1)
    return _clumps(terrain, xy, 0.2 * height, semi_axes=semi_axes, species=Species.GRASS, rng=rng)


def logs(config: ForestConfig, terrain: Terrain, distance: Floats, rng: np.random.Generator) -> Branches:
    """Dead stems on the ground, clear of the trail."""
    start = _between(config.logs_per_ha, config, terrain, distance, beside_m=LOG_M[1], rng=rng)
    length, bearing = rng.uniform(*LOG_M, len(start)), rng.uniform(0.0, 2.0 * np.pi, len(start))
    end = start + length[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    radius = rng.uniform(0.04, 0.16, len(start))
    return Branches(
        start_m=np.column_stack([start, terrain.height_at(start) + 0.8 * radius]).astype(np.float32),
        end_m=np.column_stack([end, terrain.height_at(end) + 0.8 * radius]).astype(np.float32),
        radius_m=radius.astype(np.float32),
        species=np.full(len(start), Species.OAK, np.uint8),
        reflectivity=rng.uniform(0.2, 0.35, len(start)).astype(np.float32),
        tree=np.full(len(start), -1, np.int32),
    )


def _between(
    per_ha: float,
    config: ForestConfig,
    terrain: Terrain,
    distance: Floats,
    *,
    beside_m: float,
    rng: np.random.Generator,
) -> Doubles:
    """Random places in the corridor, at least `beside_m` off the trail's edge."""
    rows, columns = terrain.height_m.shape
    size = np.array([columns - 1, rows - 1]) * terrain.cell_m
    darts = rng.uniform(0.0, 1.0, (rng.poisson(per_ha * size.prod() / 10_000.0), 2)) * size
    darts = darts + np.asarray(terrain.origin_m)
    from_route = terrain.sample(distance, darts)
    return np.asarray(darts[(from_route > 0.5 * config.trail_width_m + beside_m) & (from_route < config.corridor_m)])


def _clumps(
    terrain: Terrain,
    xy: Doubles,
    lift_m: Doubles,
    *,
    semi_axes: Doubles,
    species: Species,
    rng: np.random.Generator,
) -> Foliage:
    return clumps(
        np.column_stack([xy, terrain.height_at(xy) + lift_m]),
        semi_axes,
        species=np.full(len(xy), species, np.uint8),
        kind=Kind.GRASS if species is Species.GRASS else Kind.UNDERSTOREY,
        tree=np.full(len(xy), -1, np.int64),
        frond=np.zeros((len(xy), 3)),
        rng=rng,
    )
