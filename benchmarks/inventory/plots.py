"""Plots to be measured: simulated walks, mapped by our own odometry, and the stems that stand there."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from benchmarks.odometry.simulated import SCAN_NS, walk
from drivers.messages import ImuSample
from drivers.sim.scenarios import WorldConfig, scenario
from drivers.sim.truth import write_truth
from drivers.sim.world import build
from edge.process.sweep_odometry import SweepOdometry
from edge.replay.pairing import Sweep
from pipeline.evaluation.trajectory import Trajectory, aligned
from pipeline.inventory.source import Part
from pipeline.inventory.tilemap import TileMap
from pipeline.odometry.config import OdometryConfig
from pipeline.products.tiles import TileStore
from pipeline.products.track import Placement, TrackWriter, read_track
from pipeline.refinement.submaps import SubmapWriter

Array = npt.NDArray[np.float64]
REACH_M = 20.0
"""From the way: points farther off tell nothing of the stems that are asked for, and are three quarters of the work."""
DENSITIES = {"open": "open_trail", "mixed": "demo", "dense": "dense"}
"""Scenario of each: 280, 700 and 1300 stems a hectare."""
LENGTH_M = 45.0
FINEST_M, TILE_M = 0.01, 16.0
TILES, TRACK, SUBMAPS = "tiles", "odometry.track", "submaps"


@dataclass(frozen=True, slots=True)
class Plot:
    """A mapped walk. tiles/: the map in `odom`; odometry.track; submaps/; truth/: as the emulated payload writes it.

    placement: of the refined trajectory; None where the odometry's is meant.
    """

    folder: Path
    placement: Placement | None = None

    def way(self) -> Trajectory:
        """Of the carrier, in the frame of the map."""
        track = read_track(self.folder / TRACK)
        poses = track["position_m"], track["rotation"]
        return Trajectory(track["stamp_ns"], *(poses if self.placement is None else self.placement.poses(track)))

    def true_way(self) -> Trajectory:
        """At the same stamps, as far as places go."""
        said = self.way()
        stamps, true_m = np.load(self.folder / "true_ns.npy"), np.load(self.folder / "true_m.npy")
        at = np.column_stack([np.interp(said.stamps_ns, stamps, true_m[:, k]) for k in range(3)])
        return Trajectory(said.stamps_ns, at, said.rotations)

    def into_world(self) -> tuple[Array, Array]:
        """Turn (3, 3) and shift (3,) from the map into the simulated world, by the two trajectories."""
        said = self.way()
        laid = aligned(said, self.true_way(), "se3")
        turn = laid.rotations[0] @ said.rotations[0].T
        return turn, laid.positions_m[0] - turn @ said.positions_m[0]


class BesideWay:
    """A plot's map as far as `REACH_M` from the way, in memory."""

    def __init__(self, one: Plot, voxel_m: float) -> None:
        way_m = one.way().positions_m
        way = cKDTree(way_m[::5, :2])
        odom_m = read_track(one.folder / TRACK)["position_m"]
        whole = TileMap(one.folder / TILES, voxel_m, odom_m, one.placement)
        self._parts = [_near(part, way) for part in whole.parts()]
        self.count = sum(len(part.xyz_m) for part in self._parts)
        self.name, self.origin_m, self.crs, self.voxel_m = one.folder.name, whole.origin_m, None, voxel_m
        self.bounds_m = np.array([way_m[:, :2].min(axis=0) - REACH_M, way_m[:, :2].max(axis=0) + REACH_M])

    def placed(self, xyz_m: Array) -> Array:
        """As they are."""
        return xyz_m

    def parts(self) -> Iterator[Part]:
        """Tile by tile."""
        return iter(self._parts)


def _near(part: Part, way: cKDTree) -> Part:
    near = way.query(part.xyz_m[:, :2], distance_upper_bound=REACH_M)[0] < REACH_M
    sensor_m = None if part.sensor_m is None else part.sensor_m[near]
    return Part(part.xyz_m[near], part.reflector[near], sensor_m)


def plot(density: str, seed: int, cache: Path) -> Plot:
    """The plot of that name, mapped now or taken from `cache`."""
    folder = cache / f"{density}_{seed}"
    if not (folder / "true_m.npy").exists() or not (folder / SUBMAPS).exists():
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        _map(density, seed, folder)
    return Plot(folder)


def world_of(density: str, seed: int) -> WorldConfig:
    """What the walk leads through."""
    return replace(scenario(DENSITIES[density], seed), length_m=LENGTH_M)


def _map(density: str, seed: int, folder: Path) -> None:
    config = world_of(density, seed)
    write_truth(build(config), folder / "truth")
    cast = walk(config, folder / "walk")
    samples, used = cast.imu(), 0
    odometry = SweepOdometry(OdometryConfig())
    store, submaps = TileStore(folder / TILES, TILE_M, FINEST_M, 1 << 30), SubmapWriter(folder / SUBMAPS)
    count = 0
    with TrackWriter(folder / TRACK) as track:
        for scan in cast.scans():
            mine: list[ImuSample] = []
            while used < len(samples) and samples[used].stamp_ns <= scan.stamp_ns + SCAN_NS:
                mine.append(samples[used])
                used += 1
            for one in odometry.process(Sweep(scan, tuple(mine))):
                track.add(one.estimate)
                store.add(one.cloud, count)
                submaps.add(one.estimate, one.cloud, count)
                count += 1
    store.close()
    submaps.close()
    stamps, position_m, _, _ = cast.truth()
    np.save(folder / "true_ns.npy", stamps)
    shutil.rmtree(folder / "walk")
    np.save(folder / "true_m.npy", position_m)
