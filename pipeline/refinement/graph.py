"""The factor graph, in GTSAM: keyframes in `map`, factors of odometry, gravity, GNSS and closures.

Poses are keyed by their number. GTSAM's order of a pose's six is rotation, then position, both in the body's axes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.estimates import Array
from pipeline.refinement.closure import Closure
from pipeline.refinement.config import GnssConfig
from pipeline.refinement.fixes import Fixes, Judged
from pipeline.refinement.gnss_factors import add_fixes, insert_points
from pipeline.refinement.keyframes import Keyframes, Poses
from pipeline.refinement.library import gtsam
from pipeline.refinement.pins import Pinned

_LOOSE = (0.5, 10.0)
"""Sigmas (rad, m) of the first pose where fixes or closures place it."""
_TIGHT = (1e-4, 1e-3)
_PROBABILITY = 0.99
"""A true closure is believed with."""


class Graph:
    """Factors between keyframes. `solve` remembers what it found: covariances and evidence are those at that place."""

    def __init__(self, frames: Keyframes, level_rad: float, start: Poses) -> None:
        self._graph = gtsam.NonlinearFactorGraph()
        self._frames = frames
        self._fixes: tuple[Fixes, Judged] | None = None
        self._found = gtsam.Values()
        poses = [_pose(r, p) for r, p in zip(frames.rotations, frames.positions_m, strict=True)]
        covariances = frames.step_covariances()
        lost = set(frames.lost.tolist())
        for k in frames.steps.tolist():
            model = gtsam.noiseModel.Gaussian.Covariance(covariances[k])
            step = poses[k - 1].between(poses[k])
            if k in lost:  # there is no better word on this step than where the parts were put
                step = _of(start, k - 1).between(_of(start, k))
            self._graph.add(gtsam.BetweenFactorPose3(k - 1, k, step, model))
        level, up = gtsam.noiseModel.Isotropic.Sigma(2, level_rad), gtsam.Unit3(np.array([0.0, 0.0, 1.0]))
        for k, rotation in enumerate(frames.rotations):
            self._graph.add(gtsam.AttitudeFactorPose3(k, up, level, gtsam.Unit3(rotation[2])))

    def hold_first(self, start: Poses, *, firmly: bool) -> None:
        """Of each session. firmly: nothing else says where the first one lies."""
        for number, k in enumerate(self._frames.begins.tolist()):
            turn, place = _TIGHT if firmly and not number else _LOOSE
            model = gtsam.noiseModel.Diagonal.Sigmas(np.array([turn] * 3 + [place] * 3))
            self._graph.add(gtsam.PriorFactorPose3(k, _pose(start.rotations[k], start.positions_m[k]), model))

    def add_fixes(self, fixes: Fixes, judged: Judged, config: GnssConfig, weights: Array | None = None) -> None:
        """Those used; once. weights: (f, 2), horizontal and vertical, in place of the robust kernel."""
        add_fixes(self._graph, fixes, judged, config, weights)
        self._fixes = (fixes, judged)

    def add_pin(self, pin: Pinned) -> None:
        """A surveyed place."""
        model = gtsam.noiseModel.Isotropic.Sigma(3, pin.sigma_m)
        self._graph.add(gtsam.GPSFactorArm(pin.keyframe, pin.position_m, pin.arm_m, model))

    def add_closures(self, closures: Sequence[Closure]) -> None:
        """All of them, believed."""
        for one in closures:
            self._graph.add(_closure(one))

    def solve(self, start: Poses) -> Poses:
        """Levenberg-Marquardt from a start."""
        self._found = gtsam.LevenbergMarquardtOptimizer(self._graph, self._values(start), _settings()).optimize()
        return self._poses()

    def doubt(self, start: Poses, closures: Sequence[Closure]) -> Array:
        """(c,) 0..1 which closures agree with all else: graduated non-convexity, truncated squares.

        Closures that the analyst accepted are not doubted. GTSAM takes the robust kernels off for this: fixes are to be
        added with their weights.
        """
        graph = gtsam.NonlinearFactorGraph(self._graph)
        believed = list(range(graph.size()))
        for one in closures:
            believed += [graph.size()] if one.accepted else []
            graph.add(_closure(one))
        settings = gtsam.GncLMParams(_settings())
        settings.setLossType(gtsam.GncLossType.TLS)
        settings.setKnownInliers(believed)
        optimizer = gtsam.GncLMOptimizer(graph, self._values(start), settings)
        optimizer.setInlierCostThresholdsAtProbability(_PROBABILITY)
        optimizer.optimize()
        return np.asarray(optimizer.getWeights())[-len(closures) :]

    def covariances(self) -> Array:
        """(m, 6, 6) of each pose: position (m, `map`), then rotation (rad, the body's axes)."""
        marginals = gtsam.Marginals(self._graph, self._found)
        found = np.empty((len(self._frames), 6, 6))
        for k, rotation in enumerate(self._poses().rotations):
            turn = np.zeros((6, 6))
            turn[:3, 3:], turn[3:, :3] = rotation, np.eye(3)
            found[k] = turn @ marginals.marginalCovariance(k) @ turn.T
        return found

    def evidence(self) -> float:
        """Logarithm of how likely the measurements are, by Laplace's approximation, but for the factors' own norms."""
        net = self._graph.linearize(self._found).eliminateSequential()
        return -float(self._graph.error(self._found)) - float(net.logDeterminant())

    def _values(self, start: Poses) -> gtsam.Values:
        values = _values(start)
        if self._fixes is not None:
            fixes, judged = self._fixes
            insert_points(values, fixes, judged, antennas_m(fixes, start))
        return values

    def _poses(self) -> Poses:
        found = np.array([self._found.atPose3(k).matrix() for k in range(len(self._frames))])
        return Poses(found[:, :3, 3], found[:, :3, :3])


def antennas_m(fixes: Fixes, poses: Poses) -> Array:
    """(f, 3) in `map`, by the trajectory."""
    turned = np.einsum("fij,fj->fi", poses.rotations[fixes.keyframe], fixes.arm_m)
    return np.asarray(poses.positions_m[fixes.keyframe] + turned)


def _closure(one: Closure) -> gtsam.BetweenFactorPose3:
    model = gtsam.noiseModel.Gaussian.Covariance(one.covariance)
    return gtsam.BetweenFactorPose3(one.a, one.b, gtsam.Pose3(one.pose), model)


def _pose(rotation: Array, position_m: Array) -> gtsam.Pose3:
    return gtsam.Pose3(gtsam.Rot3(rotation), position_m)


def _of(poses: Poses, k: int) -> gtsam.Pose3:
    return _pose(poses.rotations[k], poses.positions_m[k])


def _values(poses: Poses) -> gtsam.Values:
    values = gtsam.Values()
    for k, (rotation, position_m) in enumerate(zip(poses.rotations, poses.positions_m, strict=True)):
        values.insert(k, _pose(rotation, position_m))
    return values


def _settings() -> gtsam.LevenbergMarquardtParams:
    settings = gtsam.LevenbergMarquardtParams()
    settings.setMaxIterations(100)
    settings.setRelativeErrorTol(1e-7)
    return settings
