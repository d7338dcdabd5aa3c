"""One scan after the other against the map, from a known state on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.messages import LidarScan
from pipeline.odometry.cluster_kernels import cluster
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.degeneracy import Observability, damp, observe
from pipeline.odometry.deskew_kernels import deskew
from pipeline.odometry.estimate import Cloud, Residuals
from pipeline.odometry.filter import Filter, NormalEquations, Update
from pipeline.odometry.match_kernels import match
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.state import POSITION, State
from pipeline.odometry.voxel_map import VoxelMap

DUST_MASK = 0x0F
"""Tag bits 0-3 of the Mid-360: glued to two surfaces, or particle (rain, fog, dust), at low confidence and up."""


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """What a scan gave. observability: of the scan alone; None where nothing met the map."""

    cloud: Cloud
    residuals: Residuals
    observability: Observability | None


class Tracker:
    """Filter and map together. Deterministic; not thread-safe."""

    def __init__(self, config: OdometryConfig, filter_: Filter) -> None:
        self.filter = filter_
        self.map = VoxelMap(config.map)
        self._config = config
        self._turn, self._lever = np.array(config.lidar_to_base), np.array(config.lidar_in_base_m)
        self._slots, self._owners = np.empty(0, np.int64), np.empty(0, np.int32)
        self._scan = 0
        one = config.match
        self._settings = np.array(
            [
                one.fewest_points,
                one.floor_m,
                one.huber,
                one.gate,
                one.wide,
                one.prior,
                one.prior_points,
                one.directions,
            ]
        )

    def track(self, scan: LidarScan, imu: Doubles) -> Registration:
        """Through the samples imu (m, 7), seconds after the scan's stamp, to the scan's end, then onto the map."""
        knots = self.filter.propagate(imu)
        index = self._usable(scan)
        points = self._deskew(scan, index, knots)
        clusters = self._cluster(points, scan.reflectivity[index])
        sample = self._sample(clusters)
        update, seen = self._update(sample) if len(self.map) and len(sample) else (None, None)
        # A scan that does not fit would spoil the map that it is to be found in again.
        if update is None or self._fits(update, len(sample)):
            self.map.insert(clusters, self.filter.state.rotation, self.filter.state.position_m)
        return Registration(Cloud(points.astype(np.float32), index), _residuals(len(index), len(sample), update), seen)

    def _usable(self, scan: LidarScan) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        config = self._config
        x, y, z = scan.xyz_m[:, 0], scan.xyz_m[:, 1], scan.xyz_m[:, 2]
        square = x * x + y * y + z * z
        # A comparison with a NaN is false: such points fall out here.
        keep = (square > config.nearest_m**2) & (square < config.farthest_m**2) & ((scan.tag & DUST_MASK) == 0)
        index = np.flatnonzero(keep)
        if len(index) > config.points_most:
            index = index[np.linspace(0, len(index) - 1, config.points_most).astype(np.int64)]
        return index

    def _deskew(self, scan: LidarScan, index: np.ndarray[tuple[int], np.dtype[np.int64]], knots: Doubles) -> Doubles:
        time_s = scan.offset_ns[index] * 1e-9
        return np.asarray(deskew(scan.xyz_m[index], time_s, knots, self._turn, self._lever))

    def _cluster(self, points: Doubles, intensity: np.ndarray[tuple[int], np.dtype[np.uint8]]) -> Doubles:
        places = 1 << max(2 * len(points), 1024).bit_length()
        if len(self._slots) < places:
            self._slots, self._owners = np.empty(places, np.int64), np.empty(places, np.int32)
        state, leaf = self.filter.state, self._config.match.leaf_m
        found = cluster(points, intensity, state.rotation, state.position_m, leaf, self._slots, self._owners)
        return np.asarray(found)

    def _sample(self, clusters: Doubles) -> Doubles:
        """Every so many clusters, others each time: 2,500 say as much of a pose as all 9,000."""
        stride = -(-len(clusters) // self._config.match.most)
        self._scan += 1
        return np.ascontiguousarray(clusters[self._scan % stride :: stride]) if stride > 1 else clusters

    def _update(self, clusters: Doubles) -> tuple[Update, Observability]:
        spread = float(np.sqrt(np.linalg.eigvalsh(self.filter.covariance[POSITION, POSITION])[2]))
        wide = spread > self._config.match.wide_start_m
        coarse_rounds = self._config.match.coarse_rounds if wide else 0
        seen: Observability | None = None

        def equations(guess: State, iteration: int) -> NormalEquations:
            nonlocal seen
            found = self._match(clusters, guess, coarse_only=iteration <= coarse_rounds)
            seen = observe(found.information, self._config.degeneracy)
            information, gradient = damp(found.information, found.gradient, seen, self._config.degeneracy.share_left)
            return NormalEquations(information, gradient, found.matches, found.squared, found.kept)

        update = self.filter.update(equations, coarse_rounds)
        assert seen is not None
        return update, seen

    def _match(self, clusters: Doubles, guess: State, *, coarse_only: bool) -> NormalEquations:
        first = len(self.map.sizes) - 1 if coarse_only else 0
        a, b, numbers = match(
            self.map.arrays,
            clusters,
            guess.rotation,
            guess.position_m,
            self.map.sizes,
            self._config.map.sides,
            first,
            self._settings,
        )
        count = max(float(numbers[0]), 1.0)
        # Thousands of residuals share the same few errors (section 5.4 of FAST-LIO2's practice): count them as fewer.
        share = min(1.0, self._config.match.effective / count)
        return NormalEquations(a * share, b * share, int(numbers[0]), numbers[1] / count, numbers[2] / count)

    def _fits(self, update: Update, clusters: int) -> bool:
        return update.equations.matches >= self._config.match.least_share * clusters


def _residuals(points: int, clusters: int, update: Update | None) -> Residuals:
    if update is None:
        return Residuals(points, clusters, 0, 0.0, 0.0, 0)
    found = update.equations
    return Residuals(points, clusters, found.matches, float(found.squared), float(found.kept), update.iterations)
