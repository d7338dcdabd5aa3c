"""Who the camera saw on a walk, and for how long: what a mapper can be asked to find. For evaluation only."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from drivers.sim.boxes import Annotation, tree_boxes
from drivers.sim.camera import Camera, exposure_ns
from drivers.sim.renderer import Renderer
from drivers.sim.scene import Doubles
from drivers.sim.species import Species
from drivers.sim.world import World

EVERY_FRAMES = 6
"""A fifth of a second."""


def seen_s(
    world: World, species: Collection[Species], rule: Annotation, within_ns: tuple[int, int] | None = None
) -> Doubles:
    """(n,) how long each tree of the inventory counted by the rule, in walk time or a part of it; 0 of other species.

    Renders five pictures a second: half a minute for a minute's walk.
    """
    first_ns, last_ns = within_ns or (0, world.trajectory.duration_ns)
    renderer = Renderer(world.scene, world.trajectory, Camera(), world.config.seed)
    counts = np.zeros(len(world.trees), np.int64)
    frame = 0
    while (exposed_ns := exposure_ns(frame)) <= min(last_ns, world.trajectory.duration_ns):
        if exposed_ns >= first_ns:
            renderer.render(exposed_ns)
            boxes = tree_boxes(renderer, world.trees, rule.within_m, species)
            counts[boxes.tree[rule.counts(boxes)]] += 1
        frame += EVERY_FRAMES
    return np.asarray(counts * (exposure_ns(EVERY_FRAMES) / 1e9))


def from_way_m(world: World, places_m: Doubles) -> Doubles:
    """(n,) how far places (n, 2) are from the way, in plan."""
    position, _ = world.trajectory.poses(np.arange(0, world.trajectory.duration_ns, 100_000_000))
    way = position[:, :2]
    nearest = [np.linalg.norm(way - place, axis=1).min() for place in places_m]
    return np.array(nearest, dtype=np.float64)
