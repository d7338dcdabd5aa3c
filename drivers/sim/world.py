"""One seeded world. Each emulator builds its own from the configuration, and only the parts it asks for."""

from __future__ import annotations

from functools import cached_property

from drivers.sim import forest
from drivers.sim.canopy import Antenna, cover
from drivers.sim.carriers import Carrier, carrier
from drivers.sim.forest_config import ForestConfig, preset
from drivers.sim.imu import Imu
from drivers.sim.lidar import Lidar
from drivers.sim.motion import walk
from drivers.sim.paths import Route, route
from drivers.sim.ray_grid import ray_grid
from drivers.sim.ray_kernels import RayGrid
from drivers.sim.scenarios import WorldConfig
from drivers.sim.scene import Scene, Terrain, Trees
from drivers.sim.trajectory import Trajectory


class World:
    """What there is and how it is passed through. Attributes are made at first use; ask from one thread first.

    World frame: ENU, origin at `config.datum`, where the walk starts on the ground. Times are walk time.
    """

    def __init__(self, config: WorldConfig) -> None:
        self.config = config

    @cached_property
    def forest(self) -> ForestConfig:
        """The kind of forest."""
        return preset(self.config.forest, self.config.seed)

    @cached_property
    def carrier(self) -> Carrier:
        """Who carries."""
        return carrier(self.config.carrier)

    @cached_property
    def route(self) -> Route:
        """The way, in plan."""
        return route(self.config.path, self.config.length_m, self.config.seed)

    @cached_property
    def terrain(self) -> Terrain:
        """The ground."""
        return forest.ground(self.forest, self.route)

    @cached_property
    def trees(self) -> Trees:
        """The inventory, without leaves."""
        return forest.inventory(self.forest, self.route, self.terrain)

    @cached_property
    def scene(self) -> Scene:
        """Everything, for the camera and the laser."""
        return forest.grow(self.forest, self.route, self.terrain, self.trees)

    @cached_property
    def trajectory(self) -> Trajectory:
        """True motion of `base_link`."""
        schedule, shake = self.config.schedule, self.config.shake
        return walk(self.route, self.terrain, self.carrier, schedule, seed=self.config.seed, shake=shake)

    @cached_property
    def grid(self) -> RayGrid:
        """The scene, sorted for rays."""
        return ray_grid(self.scene)

    @cached_property
    def lidar(self) -> Lidar:
        """Source of points."""
        return Lidar(self.grid, self.trajectory, self.config.lidar, self.config.seed)

    @cached_property
    def imu(self) -> Imu:
        """Source of inertial samples."""
        return Imu(self.trajectory, self.config.imu, self.config.seed)

    @cached_property
    def antenna(self) -> Antenna:
        """What is true of the GNSS antenna."""
        return Antenna(self.trajectory, self.terrain, cover(self.trees, self.terrain), self.config.antenna_m)


def build(config: WorldConfig) -> World:
    """The world of a configuration. SimulationError for unknown names, at first use of what is named."""
    return World(config)
