"""The trajectories of all sessions from their chains, fixes, pins, and the closures that are claimed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipeline.estimates import Array
from pipeline.gnss.geodesy import Datum
from pipeline.refinement.closure import Closure
from pipeline.refinement.fixes import Fixes, Judged, joined_fixes, judge
from pipeline.refinement.gnss_factors import kernel_weights, log_norm
from pipeline.refinement.graph import Graph, antennas_m
from pipeline.refinement.keyframes import Keyframes, Poses, joined
from pipeline.refinement.pins import Pinned, place_pins
from pipeline.refinement.session import Problem
from pipeline.refinement.starts import starts

_BELIEVED = 0.5
"""Weight of a closure from which on it is kept."""
_SETTLED = 0.02
"""Share by which the sigmas of the fixes may still change."""
_CLEANING = 2
"""Rounds that take wrong fixes out before sigmas are learned: those of RTK fixed, few and good, look ten times too
small while some of them are 10 m off, and would never be believed again."""
_TELLING = 0.25
"""Logarithm of the likelihood, a fix, by which a wider drift must explain the fixes better: receivers err for longer
and in other ways than the model has it, and a loose chain follows them there."""


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
    pins: tuple[Pinned, ...] = ()

    @property
    def datum(self) -> Datum | None:
        """Of `map`."""
        return None if self.fixes is None else self.fixes.datum

    @property
    def residuals_m(self) -> Array:
        """(f, 3) fix less antenna, in `map`."""
        return np.empty((0, 3)) if self.fixes is None else residuals_m(self.fixes, self.poses)

    def of(self, session: int) -> Solution:
        """The way of one session; fixes and closures stay with all of them."""
        mine = self.frames.session == session
        poses = Poses(self.poses.positions_m[mine], self.poses.rotations[mine])
        return replace(self, frames=self.frames.of(session), poses=poses, covariance=self.covariance[mine])


class Solver:
    """All sessions. `solve` may be asked again with other closures. NothingToRefine, ConstraintsRefused."""

    def __init__(self, problem: Problem) -> None:
        self._config = problem.config
        placed = problem.placed()
        frames = joined([one.frames for one in placed])
        self._fixes = joined_fixes([one.fixes for one in placed], frames.begins.tolist())
        self._start = starts(problem, placed)
        self._pins = place_pins(problem.sessions, frames, problem.constraints.pin, self.datum)
        self._scale = problem.config.chain.drift_scales[0]
        self._begun: _Fit | None = None
        if self._fixes is not None and len(problem.config.chain.drift_scales) > 1:
            self._scale, self._begun = self._likeliest(frames, self._fixes)
        self.frames = frames.drifting(self._scale)

    @property
    def datum(self) -> Datum | None:
        """Of `map`; None where no fix tells where that is."""
        return None if self._fixes is None else self._fixes.datum

    def solve(self, closures: Sequence[Closure] = ()) -> Solution:
        """With closures, each of which may be wrong."""
        fit, kept, doubted = self._fit(self.frames, [], self._begun), list(closures), []
        self._begun = fit
        if kept:
            weights = self._doubt(fit, kept)
            doubted = [one for one, weight in zip(closures, weights, strict=True) if weight < _BELIEVED]
            kept = [one for one, weight in zip(closures, weights, strict=True) if weight >= _BELIEVED]
            fit = self._fit(self.frames, kept, fit)
        found = (self.frames, fit.poses, fit.graph.covariances(), self._fixes, fit.judged, self._scale)
        return Solution(*found, tuple(kept), tuple(doubted), tuple(self._pins))

    def _likeliest(self, frames: Keyframes, fixes: Fixes) -> tuple[float, _Fit]:
        """The least drift that explains the fixes, of those that all scales leave in, about as well as the best one
        does; and the way under it. Each begins where the looser one before it ended."""
        scales, fits = sorted(self._config.chain.drift_scales, reverse=True), list[_Fit]()
        for scale in scales:
            fits.append(self._fit(frames.drifting(scale), [], fits[-1] if fits else None))
        used = np.all([_judged(fit).used for fit in fits], axis=0)
        found = [
            self._evidence(frames.drifting(scale), fixes, fit, used) for scale, fit in zip(scales, fits, strict=True)
        ]
        enough = max(found) - _TELLING * int(used.sum())
        chosen = max(k for k, evidence in enumerate(found) if evidence >= enough)
        return scales[chosen], fits[chosen]

    def _evidence(self, frames: Keyframes, fixes: Fixes, fit: _Fit, used: npt.NDArray[np.bool_]) -> float:
        judged = replace(_judged(fit), used=used)
        graph = self._graph(frames, [])
        graph.add_fixes(fixes, judged, self._config.gnss)
        graph.solve(fit.poses)
        return graph.evidence() - frames.log_spread + log_norm(fixes, judged)

    def _graph(self, frames: Keyframes, closures: Sequence[Closure]) -> Graph:
        graph = Graph(frames, math.radians(self._config.chain.level_deg), self._start)
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
        for k in range(self._config.gnss.rounds):
            graph = self._graph(frames, closures)
            learned = judged if k >= _CLEANING else replace(judged, scale=np.ones_like(judged.scale))
            graph.add_fixes(self._fixes, learned, self._config.gnss)
            poses, before = graph.solve(poses), learned
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


def _judged(fit: _Fit) -> Judged:
    assert fit.judged is not None
    return fit.judged


def _all_believed(fixes: Fixes) -> Judged:
    return Judged(np.ones(fixes.kinds), np.ones(len(fixes), bool), np.zeros((len(fixes), 2)))
