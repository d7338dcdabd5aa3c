"""Grows a forest around a route, the same from the same seed."""

from __future__ import annotations

import numpy as np

from drivers.sim import crowns, undergrowth
from drivers.sim.forest_config import ForestConfig
from drivers.sim.furniture import furnish
from drivers.sim.paths import Route
from drivers.sim.planting import plant
from drivers.sim.scene import Branches, Floats, Foliage, Scene, Terrain, Trail, Trees
from drivers.sim.terrain import distance_to, shape

MARGIN_M = 4.0
SOIL, LITTER = 0.22, 0.34


def ground(config: ForestConfig, route: Route) -> Terrain:
    """The terrain alone, for whoever needs no trees."""
    return shape(route, config.corridor_m + MARGIN_M, config.relief, config.slope, config.seed)


def inventory(config: ForestConfig, route: Route, terrain: Terrain) -> Trees:
    """The trees alone: places, species, sizes."""
    return plant(config, route, terrain, distance_to(route, terrain, config.corridor_m + MARGIN_M))


def grow(config: ForestConfig, route: Route, terrain: Terrain | None = None, trees: Trees | None = None) -> Scene:
    """The whole scene; terrain and trees where they are already there."""
    terrain = ground(config, route) if terrain is None else terrain
    distance = distance_to(route, terrain, config.corridor_m + MARGIN_M)
    trees = plant(config, route, terrain, distance) if trees is None else trees
    rng = np.random.default_rng([config.seed, 41])
    wood = crowns.branches(trees, rng)
    leaves = _join_foliage(
        crowns.crowns(trees, wood, rng),
        undergrowth.shrubs(config, terrain, distance, rng),
        undergrowth.grass(config, terrain, distance, rng),
    )
    return Scene(
        terrain=terrain,
        ground=_soil(config, distance, rng),
        trees=trees,
        stems=crowns.stems(trees, rng),
        branches=_join_branches(wood, undergrowth.logs(config, terrain, distance, rng)),
        foliage=leaves,
        boxes=furnish(route, terrain, trees, config.furniture),
        trail=Trail(route.points_m, config.trail_width_m),
    )


def _soil(config: ForestConfig, distance: Floats, rng: np.random.Generator) -> Floats:
    bare = distance < 0.5 * config.trail_width_m + 0.3
    return np.asarray(np.where(bare, SOIL, LITTER) * rng.uniform(0.8, 1.2, distance.shape), np.float32)


def _join_foliage(*parts: Foliage) -> Foliage:
    names = Foliage.__dataclass_fields__
    return Foliage(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _join_branches(*parts: Branches) -> Branches:
    names = Branches.__dataclass_fields__
    return Branches(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})
