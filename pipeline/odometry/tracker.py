"""One scan after the other against the map, from a known state on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drivers.messages import LidarScan
from pipeline.odometry.cluster_kernels import cluster
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.degeneracy import Observability, damp, observe
from pipeline.odometry.deskew_kernels import deskew
from pipeline.odometry.estimate import Cloud, Residuals
from pipeline.odometry.filter import Filter, NormalEquations, Update
from pipeline.odometry.fit import Fit, Fitting
from pipeline.odometry.match_kernels import match
from pipeline.odometry.relocate import relocate
from pipeline.odometry.so3 import Doubles
from pipeline.odometry.state import ATTITUDE, POSITION, State
from pipeline.odometry.voxel_map import VoxelMap

Index = np.ndarray[tuple[int], np.dtype[np.int64]]
NONE = np.empty((0, 3))
SCANS_A_SECOND = 10.0
LONGEST_S = 5.0
SPEED_M_S = 1.5
"""A walker may be so far from where the speed before the silence would have led."""
ARM_M = 5.0
"""At this distance an error of attitude counts like one of position."""
DUST_MASK = 0x0F
"""Tag bits 0-3 of the Mid-360: glued to two surfaces, or particle (rain, fog, dust), at low confidence and up."""


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """What a scan gave. observability: of the scan alone; None where there was nothing to match.

    fit: when not good, the filter is as the inertial samples left it. leaning: (k, 3) weak directions of the position,
    each as long (0 to 1) as scans of such a kind would rule it within a second all the same.
    """

    cloud: Cloud
    residuals: Residuals
    observability: Observability | None
    fit: Fit
    leaning: Doubles

    @property
    def weak_attitude(self) -> Doubles:
        """Directions (k, 3) of the body that the scan did not show."""
        return self.observability.weak_attitude if self.observability else NONE

    @property
    def weak_position(self) -> Doubles:
        """The same of the filter's frame."""
        return self.observability.weak_position if self.observability else NONE


class Tracker:
    """Filter and map together. Deterministic; not thread-safe."""

    def __init__(self, config: OdometryConfig, filter_: Filter) -> None:
        self.filter = filter_
        self.map = VoxelMap(config.map)
        self._config = config
        self._turn, self._lever = np.array(config.lidar_to_base), np.array(config.lidar_in_base_m)
        self._slots, self._owners = np.empty(0, np.int64), np.empty(0, np.int32)
        self._fitting = Fitting(config)
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
                one.settled_scans,
                one.fresh_share,
                one.round_m,
            ]
        )

    def track(self, scan: LidarScan, imu: Doubles) -> Registration:
        """Through the samples imu (m, 7), seconds after the scan's stamp, to the scan's end, then onto the map."""
        before = self.filter.state
        knots = self.filter.propagate(imu)
        index = usable(scan, self._config)
        points = self._deskew(scan, index, knots)
        clusters = self._cluster(points, scan.reflectivity[index])
        sample = self._sample(clusters)
        unheard_s, prior = float(np.diff(imu[:, 0]).max()), (self.filter.state, self.filter.covariance)
        first = self._relocated(clusters, before, unheard_s)
        update, seen = self._update(sample, first) if len(self.map) and len(sample) else (None, None)
        residuals = _residuals(len(index), len(sample), update)
        fit = self._fitting.judge(residuals, unheard_s) if len(self.map) else Fit.GOOD
        if fit is Fit.GOOD:
            self.map.insert(clusters, self.filter.state.rotation, self.filter.state.position_m)
        else:  # it would spoil the state, and the map that it is to be found in again
            self.filter.state, self.filter.covariance = prior
        cloud = Cloud(points.astype(np.float32), index)
        return Registration(cloud, residuals, seen, fit, _leaning(seen, prior[1], self.filter.covariance))

    def _deskew(self, scan: LidarScan, index: Index, knots: Doubles) -> Doubles:
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

    def _relocated(self, clusters: Doubles, before: State, unheard_s: float) -> State:
        """Where to begin the update: after a silence the prior's mean is too far off for that."""
        state = self.filter.state
        if unheard_s < self._config.fault.imu_gap_s or not len(self.map):
            return state
        if unheard_s > LONGEST_S:  # nobody walks on and on unheard
            state = replace(state, position_m=before.position_m + 0.5 * LONGEST_S * before.velocity_m_s)
        up = state.rotation.T @ state.gravity_m_s2 / np.linalg.norm(state.gravity_m_s2)
        yaw_sigma = float(np.sqrt(up @ self.filter.covariance[ATTITUDE, ATTITUDE] @ up))
        return relocate(self.map.places(), clusters[:, 1:4], state, yaw_sigma, SPEED_M_S * unheard_s)

    def _update(self, clusters: Doubles, first: State) -> tuple[Update, Observability]:
        wide = self._spread_m() > self._config.match.wide_start_m
        coarse_rounds = self._config.match.coarse_rounds if wide else 0
        seen: Observability | None = None

        def equations(guess: State, iteration: int) -> NormalEquations:
            nonlocal seen
            found = self._match(clusters, guess, coarse_only=iteration <= coarse_rounds)
            seen = observe(found.information, self._config.degeneracy)
            information, gradient = damp(found.information, found.gradient, seen, self._config.degeneracy.share_left)
            return NormalEquations(information, gradient, found.matches, found.squared, found.kept)

        update = self.filter.update(equations, coarse_rounds, first)
        assert seen is not None
        return update, seen

    def _spread_m(self) -> float:
        """How far a point at `ARM_M` may be from where the prior has it."""
        covariance = self.filter.covariance
        place, turn = np.linalg.eigvalsh([covariance[POSITION, POSITION], covariance[ATTITUDE, ATTITUDE]])[:, 2]
        return float(np.sqrt(max(place, ARM_M**2 * turn)))

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
        share = min(self._config.match.effective, count) / max(float(numbers[4]), 1e-9)
        return NormalEquations(a * share, b * share, int(numbers[0]), numbers[1] / count, numbers[2] / count)


def usable(scan: LidarScan, config: OdometryConfig) -> Index:
    """Which points (n,) of a scan are used: within range, finite, not tagged as dust, not too many."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.square(scan.xyz_m).sum(axis=1)
    # A comparison with a NaN is false: such points fall out here.
    keep = (square > config.nearest_m**2) & (square < config.farthest_m**2) & ((scan.tag & DUST_MASK) == 0)
    index = np.flatnonzero(keep)
    if len(index) > config.points_most:
        index = index[np.linspace(0, len(index) - 1, config.points_most).astype(np.int64)]
    return index


def _leaning(seen: Observability | None, prior: Doubles, after: Doubles) -> Doubles:
    if seen is None or not len(seen.weak_position):
        return NONE
    weak = seen.weak_position
    had, has = (np.einsum("ki,ij,kj->k", weak, c[POSITION, POSITION], weak) for c in (prior, after))
    return np.asarray(np.clip(SCANS_A_SECOND * (1.0 - has / had), 0.0, 1.0)[:, None] * weak)


def _residuals(points: int, clusters: int, update: Update | None) -> Residuals:
    if update is None:
        return Residuals(points, clusters, 0, 0.0, 0.0, 0, 0.0)
    found = update.equations
    squared, kept = float(found.squared), float(found.kept)
    return Residuals(points, clusters, found.matches, squared, kept, update.iterations, update.surprise)
