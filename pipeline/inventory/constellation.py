"""Which measured stem is which tree of a field list, by where they stand among each other and how thick they are.

Every two listed trees that are as far apart as two measured stems, and about as thick, propose a turn and a shift of
the list. A pose is worth the log-likelihood ratio of all its pairs: a stem near the place that a listed tree asks for,
and of its thickness, against a stem that stands there by chance. Thick stems are rare and speak loudest. What is
answered has to beat the best other pose, and the number of poses that were there to be tried.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

Doubles = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
PLACE_SIGMA_M, DBH_SIGMA_M, DBH_SIGMA = 0.35, 0.01, 0.05
"""Between a list and a map: compass and tape; diameters in metres and as a share."""
MISSED = 0.2
"""Of the listed trees, so many may be missing in the map."""
REACH = 3.0
"""Sigmas; beyond, a pair is none."""
LEAST_APART_M = 2.0
SPEAKERS, PROPOSALS = 60, 200_000
"""Pairs of listed trees that propose, those of rare thickness first, and poses that are looked at, at most."""
FINALISTS = 40
ROUNDS = 6
LEAST_PAIRS, LEAST_SHARE, LEAST_NATS = 4, 0.4, 10.0
"""An answer has so many pairs, of so many listed trees, and such a margin. 6 would be odds of four hundred to one were
the model true; in a made-up plantation a wrong one had 8."""
NEAR_M, NEAR_RAD = 5.0, np.radians(5.0)
"""A list in the coordinates of the map is off by its receiver and by the map's."""
TAG_NATS = 12.0
"""A tag that was read on a stem speaks for its line of the list; it was read more than once."""


@dataclass(frozen=True, slots=True, eq=False)
class Constellation:
    """places_m: (n, 2). dbh_m: (n,)."""

    places_m: Doubles
    dbh_m: Doubles


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """turn_rad, shift_m (2,): list into map. pairs: (k, 2) row of the list, row of the map; empty with a `why`.

    nats: log-likelihood ratio against chance; margin_nats: to the best other pose, or to chance where that is nearer.
    """

    turn_rad: float
    shift_m: Doubles
    pairs: Indices
    rms_m: float
    nats: float
    margin_nats: float
    why: str = ""

    def placed(self, places_m: Doubles) -> Doubles:
        """(n, 2) of the list, on the map."""
        return np.asarray(places_m @ _turn(self.turn_rad).T + self.shift_m)


def match(
    listed: Constellation, mapped: Constellation, known: npt.ArrayLike = (), *, same_frame: bool = False
) -> Match:
    """known: (k, 2) rows of list and map that are the same tree, by a tag that was read. same_frame: the list is in the
    coordinates of the map, give or take a few metres."""
    given = np.asarray(known, np.int64).reshape(-1, 2)
    if min(len(listed.dbh_m), len(mapped.dbh_m)) < LEAST_PAIRS:
        return _refused(f"{len(listed.dbh_m)} listed and {len(mapped.dbh_m)} measured trees: too few to tell by")
    chance = _Chance(listed, mapped, given, same_frame)
    poses = _proposals(listed, mapped, given[:0])
    if len(given):  # beside the others: a tag may hang on the wrong stem
        poses = np.vstack([poses, _proposals(listed, mapped, given)])
    if same_frame:
        poses = np.vstack([poses, np.zeros((1, 3))])
    if not len(poses):
        return _refused("no two listed trees are as far apart and as thick as two measured ones")
    scored = chance.quickly(poses)
    best: list[Match] = []
    for k in np.argsort(-scored)[: 20 * FINALISTS]:
        if len(best) < FINALISTS and all(_apart(poses[k], one, listed) for one in best):
            best.append(chance.refined(poses[k]))
    best.sort(key=lambda one: -one.nats)
    return _judged(best, chance)


def _judged(found: list[Match], chance: _Chance) -> Match:
    best = found[0]
    rivals = [one.nats for one in found[1:] if len(_common(one.pairs, best.pairs)) < 0.5 * len(best.pairs)]
    margin = best.nats - max([chance.poses_nats(), *rivals])
    wanted = max(LEAST_PAIRS, int(np.ceil(LEAST_SHARE * len(chance.listed.dbh_m))))
    why = ""
    if len(best.pairs) < wanted:
        why = f"at most {len(best.pairs)} of {len(chance.listed.dbh_m)} listed trees fit to measured ones at once"
    elif margin < LEAST_NATS:
        why = "the list fits in more than one place" if rivals and max(rivals) > chance.poses_nats() else "by chance"
        why = f"not enough to tell: {why} (margin {margin:.1f}, needed {LEAST_NATS:g})"
    pairs = best.pairs if not why else np.empty((0, 2), np.int64)
    return Match(best.turn_rad, best.shift_m, pairs, best.rms_m, best.nats, float(margin), why)


def _refused(why: str) -> Match:
    return Match(0.0, np.zeros(2), np.empty((0, 2), np.int64), float("nan"), 0.0, 0.0, why)


class _Chance:
    """How much better a pose explains a list than chance does."""

    def __init__(self, listed: Constellation, mapped: Constellation, known: Indices, same_frame: bool) -> None:
        self.listed, self.mapped, self.same_frame = listed, mapped, same_frame
        self._tree = cKDTree(mapped.places_m)
        self._known = np.zeros((len(listed.dbh_m), len(mapped.dbh_m)), np.bool_)
        self._known[known[:, 0], known[:, 1]] = True
        wide = np.ptp(mapped.places_m, axis=0) + 2.0
        self._area_m2 = float(wide.prod())
        self._middle = listed.places_m.mean(axis=0)
        sigma = dbh_sigma(listed.dbh_m)
        # Stems of each listed thickness, in the whole map, as its sigma blurs them.
        away = (mapped.dbh_m[None] - listed.dbh_m[:, None]) / sigma[:, None]
        usual = np.exp(-0.5 * (away / 2.0) ** 2).sum(axis=1) / (2.0 * sigma) + 0.5 / sigma
        worth = (1.0 - MISSED) / (2.0 * np.pi * PLACE_SIGMA_M**2 * sigma) * self._area_m2 / usual
        self._alike = np.log(worth)[:, None] - 0.5 * away**2

    def poses_nats(self) -> float:
        """Log of the number of poses that could be told apart: the best of so many is this good by chance."""
        if self.same_frame:
            return 0.0
        spread = float(np.sqrt(self.listed.places_m.var(axis=0).sum())) + PLACE_SIGMA_M
        return float(np.log(self._area_m2 / PLACE_SIGMA_M**2 * 2.0 * np.pi * spread / PLACE_SIGMA_M))

    def quickly(self, poses: Doubles) -> Doubles:
        """(h,) of poses (h, 3), each listed tree with the stem nearest to its place."""
        out = np.empty(len(poses))
        for first in range(0, len(poses), 5000):
            some = poses[first : first + 5000]
            cosine, sine = np.cos(some[:, 0])[:, None], np.sin(some[:, 0])[:, None]
            x, y = self.listed.places_m.T
            at = np.stack([cosine * x - sine * y + some[:, 1:2], sine * x + cosine * y + some[:, 2:3]], axis=2)
            away, which = self._tree.query(at, distance_upper_bound=REACH * PLACE_SIGMA_M)
            met = np.isfinite(away)
            which = np.where(met, which, 0)
            rows = np.arange(len(x))[None]
            gain = self._alike[rows, which] - 0.5 * (np.where(met, away, 0.0) / PLACE_SIGMA_M) ** 2
            gain = np.logaddexp(np.log(MISSED), np.where(met, gain, -np.inf)) + TAG_NATS * (
                self._known[rows, which] & met
            )
            out[first : first + 5000] = gain.sum(axis=1) + self._prior(some)
        return out

    def refined(self, pose: Doubles) -> Match:
        """One to one, moved to where its pairs fit best."""
        turn, shift = float(pose[0]), pose[1:].copy()
        pairs, nats = self._pairs(turn, shift)
        for _ in range(ROUNDS):
            if len(pairs) < 2:
                break
            turn, shift = _fitted(self.listed.places_m[pairs[:, 0]], self.mapped.places_m[pairs[:, 1]])
            again, nats = self._pairs(turn, shift)
            if np.array_equal(again, pairs):
                break
            pairs = again
        at = self.listed.places_m[pairs[:, 0]] @ _turn(turn).T + shift
        off = ((at - self.mapped.places_m[pairs[:, 1]]) ** 2).sum(axis=1)
        rms = float(np.sqrt(off.mean())) if len(off) else float("nan")
        return Match(turn, shift, pairs, rms, nats + float(self._prior(np.array([[turn, *shift]]))[0]), 0.0)

    def _pairs(self, turn: float, shift: Doubles) -> tuple[Indices, float]:
        at = self.listed.places_m @ _turn(turn).T + shift
        away = np.linalg.norm(at[:, None] - self.mapped.places_m[None], axis=2) / PLACE_SIGMA_M
        gain = self._alike - 0.5 * away**2 + TAG_NATS * self._known
        gain = np.where((away < REACH) & (gain > np.log(MISSED)), np.logaddexp(gain, np.log(MISSED)), np.log(MISSED))
        rows, columns = linear_sum_assignment(-gain)
        good = gain[rows, columns] > np.log(MISSED)
        total = gain[rows, columns].sum() + np.log(MISSED) * (len(gain) - len(rows))
        return np.column_stack([rows[good], columns[good]]).astype(np.int64), float(total)

    def _prior(self, poses: Doubles) -> Doubles:
        if not self.same_frame:
            return np.zeros(len(poses))
        x, y = self._middle
        cosine, sine = np.cos(poses[:, 0]), np.sin(poses[:, 0])
        moved = np.hypot(cosine * x - sine * y + poses[:, 1] - x, sine * x + cosine * y + poses[:, 2] - y)
        turned = np.abs((poses[:, 0] + np.pi) % (2 * np.pi) - np.pi)
        return np.asarray(-0.5 * (moved / NEAR_M) ** 2 - 0.5 * (turned / NEAR_RAD) ** 2)


def dbh_sigma(dbh_m: Doubles) -> Doubles:
    """Between a tape and a map."""
    return np.hypot(DBH_SIGMA_M, DBH_SIGMA * dbh_m)


def _proposals(listed: Constellation, mapped: Constellation, known: Indices) -> Doubles:
    """(h, 3) turn and shift that put two listed trees on two stems; with a known pair, that is one of the two."""
    a, b = _speakers(listed, mapped, known)
    widest = np.linalg.norm(listed.places_m[a] - listed.places_m[b], axis=1).max(initial=0.0)
    near = cKDTree(mapped.places_m).query_pairs(widest + REACH * PLACE_SIGMA_M, output_type="ndarray")
    near = np.vstack([near, near[:, ::-1]])
    apart = np.linalg.norm(mapped.places_m[near[:, 0]] - mapped.places_m[near[:, 1]], axis=1)
    order = np.argsort(apart)
    near, apart = near[order], apart[order]
    anchor = dict(known.tolist())
    found: list[Doubles] = []
    for i, j in zip(a.tolist(), b.tolist(), strict=True):
        length = float(np.linalg.norm(listed.places_m[i] - listed.places_m[j]))
        low, high = np.searchsorted(apart, (length - 2 * PLACE_SIGMA_M, length + 2 * PLACE_SIGMA_M))
        some = near[low:high]
        some = some[
            _alike(listed.dbh_m[i], mapped.dbh_m[some[:, 0]]) & _alike(listed.dbh_m[j], mapped.dbh_m[some[:, 1]])
        ]
        if i in anchor:
            some = some[some[:, 0] == anchor[i]]
        found.append(_poses(listed.places_m[[i, j]], mapped.places_m[some[:, 0]], mapped.places_m[some[:, 1]]))
        if sum(map(len, found)) > PROPOSALS:
            break
    return np.concatenate(found) if found else np.empty((0, 3))


def _speakers(listed: Constellation, mapped: Constellation, known: Indices) -> tuple[Indices, Indices]:
    """Pairs of listed trees, those that fewest stems are like first; with known pairs, only from these on."""
    a, b = np.triu_indices(len(listed.dbh_m), 1)
    if len(known):
        a, b = (grid.ravel() for grid in np.meshgrid(known[:, 0], np.arange(len(listed.dbh_m)), indexing="ij"))
    apart = np.linalg.norm(listed.places_m[a] - listed.places_m[b], axis=1)
    like = np.array([_alike(dbh, mapped.dbh_m).sum() + 1.0 for dbh in listed.dbh_m])
    order = np.argsort(like[a] * like[b] * np.maximum(apart, LEAST_APART_M), kind="stable")
    order = order[apart[order] > LEAST_APART_M]
    # No tree speaks more often than its share: one that is missing in the map must not be all that was heard.
    often, chosen = np.zeros(len(listed.dbh_m), int), []
    most = max(3, 4 * SPEAKERS // len(listed.dbh_m))
    for k in order.tolist():
        if len(known) or (often[a[k]] < most and often[b[k]] < most):
            often[a[k]] += 1
            often[b[k]] += 1
            chosen.append(k)
        if len(chosen) == SPEAKERS:
            break
    return a[chosen].astype(np.int64), b[chosen].astype(np.int64)


def _alike(dbh_m: float, others_m: Doubles) -> npt.NDArray[np.bool_]:
    return np.asarray(np.abs(others_m - dbh_m) < REACH * dbh_sigma(np.array([dbh_m])))


def _poses(two: Doubles, first: Doubles, second: Doubles) -> Doubles:
    """(h, 3) turn and shift that bring two places (2, 2) onto each of (h, 2) and (h, 2), their middles together."""
    have, want = two[1] - two[0], second - first
    turn = np.arctan2(want[:, 1], want[:, 0]) - np.arctan2(have[1], have[0])
    middle = two.mean(axis=0)
    cosine, sine = np.cos(turn), np.sin(turn)
    moved = np.column_stack([cosine * middle[0] - sine * middle[1], sine * middle[0] + cosine * middle[1]])
    return np.column_stack([turn, 0.5 * (first + second) - moved])


def _fitted(have: Doubles, want: Doubles) -> tuple[float, Doubles]:
    """Least squares, closed form."""
    a, b = have - have.mean(axis=0), want - want.mean(axis=0)
    turn = float(np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a * b).sum()))
    return turn, want.mean(axis=0) - _turn(turn) @ have.mean(axis=0)


def _turn(angle: float) -> Doubles:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _apart(pose: Doubles, other: Match, listed: Constellation) -> bool:
    """Whether two poses put the list in different places."""
    at = listed.places_m @ _turn(float(pose[0])).T + pose[1:]
    return bool(np.sqrt(((at - other.placed(listed.places_m)) ** 2).sum(axis=1).mean()) > 2.0 * PLACE_SIGMA_M)


def _common(one: Indices, other: Indices) -> set[tuple[int, ...]]:
    return set(map(tuple, one.tolist())) & set(map(tuple, other.tolist()))
