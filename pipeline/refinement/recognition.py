"""Places known again by the constellation of their stems, wherever the trajectory has them.

Triangles of neighbouring stems, rare ones first, propose that a submap lies on an earlier one, turned and shifted; what
many of them agree on is judged by all stems: those that are met, and those that should have been and are not. A stand
in rows fits itself in many ways, which is told by the next best of them. What is proposed is registered and judged as
any other candidate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pipeline.estimates import Array
from pipeline.refinement.config import RecognitionConfig
from pipeline.refinement.constraints import Guess
from pipeline.refinement.stems import Place, Triangles, triangles

_SAME_M = 0.15
"""Between the sides of one triangle seen twice."""
_MIRRORED_M = 100.0
"""Keeps triangles that turn the other way apart."""
_MOST = 300_000
"""Triangles alike that are looked at for one place: those of which there are fewest come first."""
_BIN_M, _BIN_RAD = 1.5, math.radians(6.0)
_PLACES, _POSES = 6, 8
"""Earlier places a place, and poses in each, that are judged by all stems."""
_ROUNDS = 4
_MET = 0.7
"""Of the stems that should be met, so many are."""
_LEVEL_M = 0.3
"""Within this the rises of stems from one ground to the other are the same."""
_SPAN = 1 << 12
Rows = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Recognised:
    """Place b on place a < b: turn (rad) and shift_m (3,) from `odom` of b into that of a.

    met: stems of b that meet one of a, of `asked` that should. nats: log-likelihood ratio against chance. rival_m: to
    the next pose that meets nearly as many, or infinite.
    """

    a: int
    b: int
    turn: float
    shift_m: Array
    met: int
    asked: int
    nats: float
    rival_m: float = math.inf

    @property
    def sure(self) -> bool:
        """Whether the stems fit in this way alone."""
        return math.isinf(self.rival_m)

    def pose(self) -> Array:
        """(4, 4)."""
        c, s = math.cos(self.turn), math.sin(self.turn)
        found = np.eye(4)
        found[:2, :2], found[:3, 3] = [[c, -s], [s, c]], self.shift_m
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """guess: b as seen from a, as an analyst would say it. found: what it rests on, its places numbered as they were
    then. confirmed: how many others agree with it."""

    guess: Guess
    found: Recognised
    confirmed: int = 0


def recognise(
    places: Sequence[Place], allowed: npt.NDArray[np.bool_], config: RecognitionConfig
) -> Iterator[list[Recognised]]:
    """Of each place in turn: on earlier ones, the best first. allowed: (n, n) whether b may be sought on a."""
    index = _Index(places)
    for b in range(len(places)):
        found = []
        for a, poses in index.proposals(b, allowed[:b, b]):
            looked = (_judged((a, b), (places[a], places[b]), pose, config) for pose in poses)
            judged = [one for one in looked if one is not None]
            if judged:
                found.append(_with_rival(judged, places[b], config))
        yield sorted((one for one in found if one.nats >= config.least_nats), key=lambda one: -one.nats)


class _Index:
    """The triangles of all places."""

    def __init__(self, places: Sequence[Place]) -> None:
        self._places = places
        self._own = [triangles(one.stems_m) for one in places]
        self._starts = np.cumsum([0, *(len(one.sides_m) for one in self._own)])
        self._of = np.repeat(np.arange(len(places)), np.diff(self._starts))
        self._keys = np.concatenate([_key(one) for one in self._own])
        self._tree = cKDTree(self._keys)
        corners = [one.stems_m[own.corners, :2] for one, own in zip(places, self._own, strict=True)]
        self._corners = np.concatenate(corners)

    def proposals(self, b: int, allowed: npt.NDArray[np.bool_]) -> Iterator[tuple[int, list[tuple[float, Array]]]]:
        """Earlier places, and poses (turn, shift of the middle of the stems) that the most triangles agree on."""
        theirs, ours = self._alike(b, allowed)
        if not len(theirs):
            return
        there, here = self._corners[theirs], self._corners[ours]
        turn = _heading(there) - _heading(here)
        middle = self._places[b].stems_m[:, :2].mean(axis=0)
        at = _turned(middle - here.mean(axis=1), turn) + there.mean(axis=1)
        where = np.floor(at / _BIN_M).astype(np.int64) % _SPAN
        heading = np.floor(np.mod(turn, 2.0 * math.pi) / _BIN_RAD).astype(np.int64)
        bins = ((self._of[theirs] * _SPAN + where[:, 0]) * _SPAN + where[:, 1]) * 64 + heading
        _, first, member, votes = np.unique(bins, return_index=True, return_inverse=True, return_counts=True)
        owner = self._of[theirs][first]
        order = np.argsort(-votes, kind="stable")
        order = order[votes[order] > 1]
        for a in list(dict.fromkeys(owner[order].tolist()))[:_PLACES]:
            best = order[owner[order] == a][:_POSES]
            agreed = [member == one for one in best.tolist()]
            yield a, [(_mean_angle(turn[rows]), at[rows].mean(axis=0)) for rows in agreed]

    def _alike(self, b: int, allowed: npt.NDArray[np.bool_]) -> tuple[Rows, Rows]:
        """Rows of triangles of earlier places, and of this one."""
        own = np.arange(self._starts[b], self._starts[b + 1])
        if not len(own) or not allowed.any():
            return own[:0], own[:0]
        count = self._tree.query_ball_point(self._keys[own], _SAME_M, return_length=True)
        order = np.argsort(count, kind="stable")
        own = own[order[np.cumsum(count[order]) <= _MOST]]
        found = self._tree.query_ball_point(self._keys[own], _SAME_M)
        ours = np.repeat(own, [len(one) for one in found])
        theirs = np.concatenate([np.asarray(one, np.int64) for one in found]) if len(own) else own
        earlier = self._of[theirs] < b
        earlier[earlier] = allowed[self._of[theirs[earlier]]]
        return theirs[earlier], ours[earlier]


def _judged(
    numbers: tuple[int, int], places: tuple[Place, Place], pose: tuple[float, Array], config: RecognitionConfig
) -> Recognised | None:
    """A pose, refined on the stems that are met; None where too few are."""
    (there, here), (turn, at_m) = (one.stems_m for one in places), pose
    tree, middle = cKDTree(there[:, :2]), here[:, :2].mean(axis=0)
    shift = at_m - _turned(middle[None], np.array([turn]))[0]
    for k in range(_ROUNDS):
        placed = _turned(here[:, :2], np.full(len(here), turn)) + shift
        away, which = tree.query(placed)
        met = np.asarray(away) < config.met_m * (2.0 if k == 0 else 1.0)
        if met.sum() < config.least_stems:
            return None
        if k < _ROUNDS - 1:
            turn, shift = _fitted(there[np.asarray(which)[met], :2], here[met, :2])
    asked = places[0].seen(placed)
    met &= asked
    rises = there[np.asarray(which)[met], 2] - here[met, 2]
    if met.sum() < config.least_stems:
        return None
    area_m2 = max(float(places[0].looked.sum()) * places[0].grid.cell_m ** 2, 1.0)
    by_chance = 1.0 - math.exp(-len(there) / area_m2 * math.pi * config.met_m**2)
    hits, misses = int(met.sum()), int(asked.sum() - met.sum())
    nats = hits * math.log(_MET / by_chance) + misses * math.log((1.0 - _MET) / (1.0 - by_chance))
    return Recognised(*numbers, turn, np.append(shift, _mostly(rises)), hits, hits + misses, nats)


def _mostly(rises_m: Array) -> float:
    """Where most of them lie together: under the rim of what a walk shows, half of the ground is a guess."""
    ordered = np.sort(rises_m)
    ends = np.searchsorted(ordered, ordered + _LEVEL_M, side="right")
    first = int(np.argmax(ends - np.arange(len(ordered))))
    return float(ordered[first : ends[first]].mean())


def _with_rival(judged: Sequence[Recognised], here: Place, config: RecognitionConfig) -> Recognised:
    """The best of some poses on one place, and how far the next one is that is nearly as good."""
    best = max(judged, key=lambda one: one.nats)
    middle = here.stems_m.mean(axis=0)
    share, rival_m = config.rival_share * best.met / best.asked, math.inf
    for one in judged:
        apart = float(np.linalg.norm((one.pose()[:3] - best.pose()[:3]) @ np.append(middle, 1.0)))
        turned = abs(math.remainder(one.turn - best.turn, 2.0 * math.pi))
        if (apart > config.rival_m or turned > config.rival_rad) and one.met / one.asked >= share:
            rival_m = min(rival_m, apart)
    return replace(best, rival_m=rival_m)


def _fitted(there: Array, here: Array) -> tuple[float, Array]:
    """Turn and shift (2,) of points (k, 2) onto others, least squares."""
    one, two = there - there.mean(axis=0), here - here.mean(axis=0)
    turn = math.atan2(float((two[:, 0] * one[:, 1] - two[:, 1] * one[:, 0]).sum()), float((two * one).sum()))
    return turn, there.mean(axis=0) - _turned(here.mean(axis=0)[None], np.array([turn]))[0]


def _key(own: Triangles) -> Array:
    return np.column_stack([own.sides_m, _MIRRORED_M * own.left])


def _heading(corners: Array) -> Array:
    """(t,) of the longest side, from corners (t, 3, 2)."""
    along = corners[:, 1] - corners[:, 0]
    return np.asarray(np.arctan2(along[:, 1], along[:, 0]))


def _turned(xy: Array, turn: Array) -> Array:
    c, s = np.cos(turn), np.sin(turn)
    return np.column_stack([c * xy[:, 0] - s * xy[:, 1], s * xy[:, 0] + c * xy[:, 1]])


def _mean_angle(angles: Array) -> float:
    return math.atan2(float(np.sin(angles).sum()), float(np.cos(angles).sum()))
