"""The trajectory of one session from its chain, its fixes, its pins, and the closures that are claimed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from drivers.messages import GnssFix
from pipeline.estimates import Array
from pipeline.gnss.alignment import align
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.geodesy import Datum
from pipeline.refinement.closure import Closure
from pipeline.refinement.config import RefinementConfig
from pipeline.refinement.constraints import Constraints
from pipeline.refinement.fixes import Fixes, Judged, judge, place_fixes
from pipeline.refinement.gnss_factors import kernel_weights, log_norm
from pipeline.refinement.graph import Graph, antennas_m
from pipeline.refinement.keyframes import Keyframes, Poses, keyframes
from pipeline.refinement.pins import place_pins

_BELIEVED = 0.5
"""Weight of a closure from which on it is kept."""
_SETTLED = 0.02
"""Share by which the sigmas of the fixes may still change."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """What one session brings. track: (n,) of ESTIMATE. Without fixes the way begins where it does in `odom`."""

    track: npt.NDArray[np.void]
    fixes: Sequence[GnssFix]
    fusion: FusionConfig
    config: RefinementConfig
    constraints: Constraints = field(default_factory=Constraints)

    @property
    def duration_s(self) -> float:
        """From the first pose to the last."""
        stamps = self.track["stamp_ns"]
        return float(stamps[-1] - stamps[0]) / 1e9 if len(stamps) else 0.0

    def kept_fixes(self) -> list[GnssFix]:
        """Without the stretches that the analyst dropped."""
        began = int(self.track["stamp_ns"][0]) if len(self.track) else 0
        dropped = [(began + round(s.from_s * 1e9), began + round(s.to_s * 1e9)) for s in self.constraints.drop_gnss]
        return [fix for fix in self.fixes if not any(a <= fix.stamp_ns <= b for a, b in dropped)]


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Keyframes in `map`, or in `odom` without fixes that place them.

    covariance: (m, 6, 6) of position (m), then rotation (rad, the body's axes). residuals_m: (f, 3) of the fixes.
    drift_scale: by which the odometry's sigmas had to be multiplied. closures: believed. doubted: not.
    """

    frames: Keyframes
    poses: Poses
    covariance: Array
    fixes: Fixes | None
    judged: Judged | None
    drift_scale: float
    closures: tuple[Closure, ...] = ()
    doubted: tuple[Closure, ...] = ()

    @property
    def datum(self) -> Datum | None:
        """Of `map`."""
        return None if self.fixes is None else self.fixes.datum

    @property
    def residuals_m(self) -> Array:
        """(f, 3) fix less antenna, in `map`."""
        return np.empty((0, 3)) if self.fixes is None else residuals_m(self.fixes, self.poses)


class Solver:
    """One session. `solve` may be asked again with other closures. NothingToRefine, ConstraintsRefused."""

    def __init__(self, problem: Problem) -> None:
        self._config = problem.config
        frames = keyframes(problem.track, problem.config.chain)
        kept = problem.kept_fixes()
        fixes = place_fixes(problem.track, frames, kept, problem.fusion) if kept else None
        start = None if fixes is None else _placed(frames, fixes, problem.fusion)
        self._fixes = None if start is None else fixes
        self._start = start or Poses(frames.positions_m, frames.rotations)
        datum = None if self._fixes is None else self._fixes.datum
        self._pins = place_pins(problem.track, frames, problem.constraints.pin, datum)
        self._scale = problem.config.chain.drift_scales[0]
        if self._fixes is not None and len(problem.config.chain.drift_scales) > 1:
            self._scale = self._likeliest(frames, self._fixes)
        self.frames = frames.drifting(self._scale)

    def solve(self, closures: Sequence[Closure] = ()) -> Solution:
        """With closures, each of which may be wrong."""
        fit, kept, doubted = self._fit(self.frames, []), list(closures), []
        if kept:
            weights = self._doubt(fit, kept)
            doubted = [one for one, weight in zip(closures, weights, strict=True) if weight < _BELIEVED]
            kept = [one for one, weight in zip(closures, weights, strict=True) if weight >= _BELIEVED]
            fit = self._fit(self.frames, kept, fit)
        found = (self.frames, fit.poses, fit.graph.covariances(), self._fixes, fit.judged, self._scale)
        return Solution(*found, tuple(kept), tuple(doubted))

    def _likeliest(self, frames: Keyframes, fixes: Fixes) -> float:
        """Which drift explains the fixes best, of those that the loosest of them leaves in."""
        scales, used, found = sorted(self._config.chain.drift_scales, reverse=True), None, []
        for scale in scales:
            drifting = frames.drifting(scale)
            fit = self._fit(drifting, [])
            assert fit.judged is not None
            used = fit.judged.used if used is None else used
            judged = replace(fit.judged, used=used)
            graph = self._graph(drifting, [])
            graph.add_fixes(fixes, judged, self._config.gnss)
            graph.solve(fit.poses)
            spread = 0.5 * float(np.log(drifting.drifted).sum())
            found.append(graph.evidence() - spread + log_norm(fixes, judged))
        return scales[int(np.argmax(found))]

    def _graph(self, frames: Keyframes, closures: Sequence[Closure]) -> Graph:
        graph = Graph(frames, math.radians(self._config.chain.level_deg))
        graph.hold_first(self._start, firmly=self._fixes is None)
        graph.add_closures(closures)
        for pin in self._pins:
            graph.add_pin(pin)
        return graph

    def _fit(self, frames: Keyframes, closures: Sequence[Closure], begun: _Fit | None = None) -> _Fit:
        """The trajectory judges the fixes, and they the trajectory, until both agree."""
        graph = self._graph(frames, closures)
        poses = self._start if begun is None else begun.poses
        if self._fixes is None:
            return _Fit(graph, graph.solve(poses), None)
        judged = _all_believed(self._fixes) if begun is None or begun.judged is None else begun.judged
        for _ in range(self._config.gnss.rounds):
            graph = self._graph(frames, closures)
            graph.add_fixes(self._fixes, judged, self._config.gnss)
            poses, before = graph.solve(poses), judged
            judged = judge(self._fixes, residuals_m(self._fixes, poses), self._config.gnss)
            if np.array_equal(before.used, judged.used) and np.allclose(before.scale, judged.scale, rtol=_SETTLED):
                break
        return _Fit(graph, poses, judged)

    def _doubt(self, fit: _Fit, closures: Sequence[Closure]) -> Array:
        """(c,) 0..1."""
        graph = self._graph(self.frames, [])
        if self._fixes is not None and fit.judged is not None:
            weights = kernel_weights(fit.judged.chi2, self._config.gnss)
            graph.add_fixes(self._fixes, fit.judged, self._config.gnss, weights)
        return graph.doubt(fit.poses, closures)


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    graph: Graph
    poses: Poses
    judged: Judged | None


def residuals_m(fixes: Fixes, poses: Poses) -> Array:
    """(f, 3) fix less antenna, in `map`."""
    return np.asarray(fixes.position_m - antennas_m(fixes, poses))


def _all_believed(fixes: Fixes) -> Judged:
    return Judged(np.ones(3), np.ones(len(fixes), bool), np.zeros((len(fixes), 2)))


def _placed(frames: Keyframes, fixes: Fixes, config: FusionConfig) -> Poses | None:
    """The whole chain turned and moved to the fixes; None where these cannot tell the heading."""
    seconds = fixes.stamps_ns / 1e9
    lasting_s = 2.0 * config.correlation_s
    share = np.diff(seconds, prepend=seconds[0] - lasting_s) / lasting_s if lasting_s else np.ones(len(seconds))
    found = align(fixes.odom_m, fixes.position_m, fixes.sigma_m, np.clip(share, 1e-3, 1.0))
    if not math.degrees(found.yaw_sigma) < config.yaw_known_deg:
        return None
    turn = np.array(
        [[math.cos(found.yaw), -math.sin(found.yaw), 0.0], [math.sin(found.yaw), math.cos(found.yaw), 0.0], [0, 0, 1.0]]
    )
    positions = (frames.positions_m - found.centre_odom_m) @ turn.T + found.centre_map_m
    return Poses(positions, turn @ frames.rotations)
