"""Closing loops: every candidate registered, and judged for itself. What all of them say together, the graph judges."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimates import Array
from pipeline.refinement.agreement import agree
from pipeline.refinement.candidates import Candidate, candidates, guesses, keys_of
from pipeline.refinement.closure import Closure
from pipeline.refinement.constraints import Guess, Pair, number_of
from pipeline.refinement.recognition import Recognised
from pipeline.refinement.registration import Cloud, Registered, register
from pipeline.refinement.session import Problem
from pipeline.refinement.solver import Solution
from pipeline.refinement.starts import levelled, pose_of, turned_round

FORBIDDEN, BY_HAND = "forbidden by the constraints", "accepted by the constraints"
Place = tuple[int, int, bytes]
"""Two submaps, and where the one is looked for from the other."""
_CLOUDS = 40
"""Submaps that wait in memory, 2 MB each."""


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """On one candidate. closure: what it would say, believed when `reason` is empty or by hand."""

    candidate: Candidate
    keys: tuple[int, int]
    reason: str
    closure: Closure | None = None
    registered: Registered | None = None
    correction_m: float = math.nan

    @property
    def sound(self) -> bool:
        """Whether it is believed."""
        return self.closure is not None and self.reason in ("", BY_HAND)


class Closing:
    """The submaps of all sessions, against their trajectories so far. known: registered before; added to."""

    def __init__(self, problem: Problem, solved: Solution, known: dict[Place, Registered]) -> None:
        self._submaps = [submap for session in problem.sessions for submap in session.submaps]
        self._solved, self._names = solved, problem.names
        self._config, self._asked = problem.config.closures, problem.constraints
        self._recognised, self._known = problem.recognised, known
        self._keys = keys_of([session.submaps for session in problem.sessions], solved.frames)
        self._clouds: dict[int, Cloud] = {}

    def verdicts(self, advance: Callable[[float], None]) -> list[Verdict]:
        """Of all candidates, the analyst's among them."""
        solved = self._solved
        near = candidates(self._keys, solved.frames, solved.poses, solved.covariance, self._config)
        pairs = {(one.a, one.b): one for one in near}
        for proposal in self._recognised:
            one = self._guessed(proposal.guess, proposal.found)
            if proposal.found.sure or (one.a, one.b) not in pairs:
                pairs[one.a, one.b] = one
        found = [*pairs.values(), *(self._guessed(guess) for guess in self._asked.closure)]
        judged = []
        for k, candidate in enumerate(found):
            judged.append(self._judge(candidate))
            advance((k + 1) / len(found))
        return [self._confirmed(one, judged) for one in judged]

    def _judge(self, candidate: Candidate) -> Verdict:
        keys = (self._keys[candidate.a], self._keys[candidate.b])
        if self._named(candidate, self._asked.forbid):
            return Verdict(candidate, keys, FORBIDDEN)
        known, by_hand = candidate.recognised, self._named(candidate, self._asked.accept)
        if known is not None and not known.sure and not by_hand:
            return Verdict(candidate, keys, f"ambiguous: a pose {known.rival_m:.1f} m away meets nearly as many stems")
        expected = (
            np.linalg.inv(self._pose(keys[0])) @ self._pose(keys[1]) if candidate.guess is None else candidate.guess
        )
        found = self._registered(candidate, expected)
        correction = found.pose @ np.linalg.inv(expected)
        reason = BY_HAND if by_hand else self._reason(found, keys, candidate)
        closure = Closure(*keys, found.pose, found.covariance, accepted=by_hand)
        return Verdict(candidate, keys, reason, closure, found, float(np.linalg.norm(correction[:3, 3])))

    def _registered(self, candidate: Candidate, expected: Array) -> Registered:
        """Once for each guess: that of stems or of the analyst stays what it is."""
        place = (candidate.a, candidate.b, expected.tobytes())
        if place not in self._known:
            around = guesses(expected, candidate.sigma_m)
            self._known[place] = register(self._cloud(candidate.a), self._cloud(candidate.b), around, self._config)
        return self._known[place]

    def _reason(self, found: Registered, keys: tuple[int, int], candidate: Candidate) -> str:
        """Why not; empty when there is none."""
        config = self._config
        if found.overlap < config.least_overlap:
            return f"overlap {found.overlap:.2f}, less than {config.least_overlap:.2f}"
        if found.weak:
            return "degenerate: the submaps leave a direction open"
        if found.rival_m < math.inf:
            return f"ambiguous: a pose {found.rival_m:.1f} m away fits nearly as well"
        a, b = (self._solved.frames.rotations[key] for key in keys)
        tilt = math.degrees(math.acos(min(float((a @ found.pose[:3, :3])[2] @ b[2]), 1.0)))
        if tilt > config.tilt_deg:
            return f"tilted by {tilt:.1f} degrees against gravity"
        if candidate.guess is None:
            chi2 = self._surprise(found, keys)
            if chi2 > config.surprise:
                return f"farther off than the trajectory allows (chi-square {chi2:.0f}, at most {config.surprise:.0f})"
        return ""

    def _surprise(self, found: Registered, keys: tuple[int, int]) -> float:
        """Chi-square of four degrees of freedom, place and yaw, by the covariances of both ends, taken as apart."""
        a, b = (self._pose(key) for key in keys)
        claimed = a @ found.pose
        turn = claimed[:3, :3] @ b[:3, :3].T
        off = np.array([*(claimed[:3, 3] - b[:3, 3]), math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])])
        covariance, rotations = self._solved.covariance, self._solved.poses.rotations
        spread = np.sum([_upright(covariance[key], rotations[key]) for key in keys], axis=0)
        arm = claimed[:3, 3] - a[:3, 3]
        yaw = _upright(self._solved.covariance[keys[0]], a[:3, :3])[3, 3]
        spread[:2, :2] += yaw * np.outer([-arm[1], arm[0]], [-arm[1], arm[0]])
        own = np.kron(np.eye(2), claimed[:3, :3])
        spread[:3, :3] += (own @ found.covariance @ own.T)[3:, 3:]
        spread[3, 3] += (own @ found.covariance @ own.T)[2, 2]
        return float(off @ np.linalg.solve(spread, off))

    def _confirmed(self, one: Verdict, judged: Sequence[Verdict]) -> Verdict:
        """What stems alone speak for is not believed on the word of one place."""
        if one.candidate.recognised is None or not one.sound or one.reason == BY_HAND:
            return one
        if any(self._agree(one, other) for other in judged if other.sound):
            return one
        return replace(one, reason="known again by its stems, but no other place confirms it")

    def _agree(self, one: Verdict, other: Verdict) -> bool:
        frames, ends = self._solved.frames, (list(one.keys), list(other.keys))
        if one.keys[1] == other.keys[1] or (frames.session[ends[0]] != frames.session[ends[1]]).any():
            return False
        way_m = float(np.abs(frames.travelled_m[ends[0]] - frames.travelled_m[ends[1]]).sum())
        return agree(self._claimed(one), self._claimed(other), frames.positions_m[one.keys[1]], way_m)

    def _claimed(self, one: Verdict) -> Array:
        """(4, 4) `odom` of b in `odom` of a."""
        frames, poses = self._solved.frames, np.tile(np.eye(4), (2, 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = frames.rotations[list(one.keys)], frames.positions_m[list(one.keys)]
        assert one.closure is not None
        return np.asarray(poses[0] @ one.closure.pose @ np.linalg.inv(poses[1]))

    def _guessed(self, guess: Guess, recognised: Recognised | None = None) -> Candidate:
        if self._submap_at(guess.a, guess.a_s) > self._submap_at(guess.b, guess.b_s):
            guess = turned_round(guess)
        a, b = self._submap_at(guess.a, guess.a_s), self._submap_at(guess.b, guess.b_s)
        from_a, from_b = self._seen_from(a, guess.a, guess.a_s), self._seen_from(b, guess.b, guess.b_s)
        apart_m = float(np.linalg.norm(self._pose(self._keys[a])[:2, 3] - self._pose(self._keys[b])[:2, 3]))
        return Candidate(a, b, apart_m, 1.0, from_a @ pose_of(guess) @ np.linalg.inv(from_b), recognised)

    def _submap_at(self, name: str, second: float) -> int:
        number, frames = number_of(name, self._names), self._solved.frames
        away = [abs(frames.seconds[key] - second) if frames.session[key] == number else math.inf for key in self._keys]
        return int(np.argmin(away))

    def _named(self, candidate: Candidate, pairs: Sequence[Pair]) -> bool:
        ends = {candidate.a, candidate.b}
        return any({self._submap_at(pair.a, pair.a_s), self._submap_at(pair.b, pair.b_s)} == ends for pair in pairs)

    def _seen_from(self, submap: int, name: str, second: float) -> Array:
        """(4, 4) where the carrier was at a time, levelled, as seen from the keyframe of a submap, by the odometry."""
        frames, number = self._solved.frames, number_of(name, self._names)
        began = frames.stamps_ns[frames.begins[number]]
        other = int(frames.nearest(np.array([began + round(second * 1e9)]), number)[0])
        there, here = levelled(frames.rotations[other], frames.positions_m[other]), np.eye(4)
        here[:3, :3], here[:3, 3] = frames.rotations[self._keys[submap]], frames.positions_m[self._keys[submap]]
        return np.asarray(np.linalg.inv(here) @ there)

    def _pose(self, key: int) -> Array:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self._solved.poses.rotations[key], self._solved.poses.positions_m[key]
        return pose

    def _cloud(self, submap: int) -> Cloud:
        if submap not in self._clouds:
            if len(self._clouds) >= _CLOUDS:
                del self._clouds[next(iter(self._clouds))]
            frames, key = self._solved.frames, self._keys[submap]
            points = self._submaps[submap].points() - frames.positions_m[key]
            self._clouds[submap] = Cloud(points @ frames.rotations[key])
        return self._clouds[submap]


def _upright(covariance: Array, rotation: Array) -> Array:
    """(4, 4) of position and yaw, from (6, 6)."""
    to = np.zeros((4, 6))
    to[:3, :3], to[3, 3:] = np.eye(3), rotation[2]
    return np.asarray(to @ covariance @ to.T)
