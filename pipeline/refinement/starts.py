"""Where the sessions lie to each other before anything is solved, and which of them belong together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipeline.estimates import Array
from pipeline.gnss.geodesy import Datum
from pipeline.refinement.constraints import Guess, number_of
from pipeline.refinement.keyframes import Keyframes, Poses
from pipeline.refinement.session import Placed, Problem, about_vertical


def starts(problem: Problem, placed: Sequence[Placed]) -> Poses:
    """All keyframes in one frame: `map` of the first session with fixes, or `odom` of the first.

    A session without fixes lies where a `[[closure]]` has it, or stems that were known again, or else where its `odom`
    begins.
    """
    datum = next((one.fixes.datum for one in placed if one.fixes is not None), None)
    found = {k: _moved(one, datum) for k, one in enumerate(placed) if one.fixes is not None and datum is not None}
    if not found:
        found[0] = placed[0].start
    for _ in placed:
        for a, b, guess in _guesses(problem):
            for known, other, pose in ((a, b, guess), (b, a, turned_round(guess))):
                if known in found and other not in found:
                    found[other] = _hung(placed[known].frames, found[known], placed[other], pose)
    ways = [found.get(k, one.start) for k, one in enumerate(placed)]
    return Poses(np.concatenate([w.positions_m for w in ways]), np.concatenate([w.rotations for w in ways]))


def groups(problem: Problem, placed: Sequence[Placed]) -> list[list[int]]:
    """Sessions that come near each other by their fixes, or that a `[[closure]]` or stems join; the largest first."""
    pairs = {(a, b) for a, b, _ in _guesses(problem)}
    on_earth = {k: one for k, one in enumerate(placed) if one.fixes is not None}
    for b, later in on_earth.items():
        assert later.fixes is not None
        tree = cKDTree(later.start.positions_m[:, :2])
        for a in (a for a in on_earth if a < b):
            apart, _ = tree.query(_moved(on_earth[a], later.fixes.datum).positions_m[:, :2])
            if float(np.min(apart)) < problem.config.closures.most_m:
                pairs.add((a, b))
    ends = np.array([*pairs], dtype=np.int64).reshape(-1, 2)
    joins = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(placed), len(placed)))
    _, label = connected_components(joins, directed=False)
    found = [np.flatnonzero(label == one).tolist() for one in dict.fromkeys(label.tolist())]
    return sorted(found, key=len, reverse=True)


def turned_round(guess: Guess) -> Guess:
    """The same, a as seen from b."""
    c, s = math.cos(math.radians(guess.yaw_deg)), math.sin(math.radians(guess.yaw_deg))
    x_m, y_m = -c * guess.x_m - s * guess.y_m, s * guess.x_m - c * guess.y_m
    return Guess(guess.b_s, guess.a_s, x_m, y_m, -guess.z_m, -guess.yaw_deg, guess.b, guess.a)


def pose_of(guess: Guess) -> Array:
    """(4, 4)."""
    pose = np.eye(4)
    pose[:3, :3] = about_vertical(math.radians(guess.yaw_deg))
    pose[:3, 3] = guess.x_m, guess.y_m, guess.z_m
    return pose


def levelled(rotation: Array, position_m: Array) -> Array:
    """(4, 4) a pose, its heading kept and the rest made level."""
    pose = np.eye(4)
    pose[:3, :3] = about_vertical(math.atan2(rotation[1, 0], rotation[0, 0]))
    pose[:3, 3] = position_m
    return pose


def _guesses(problem: Problem) -> Iterator[tuple[int, int, Guess]]:
    """Between sessions: the analyst's, then those by stems that the most others confirm."""
    known = sorted(problem.recognised, key=lambda one: -one.confirmed)
    for guess in (*problem.constraints.closure, *(one.guess for one in known if one.confirmed)):
        a, b = number_of(guess.a, problem.names), number_of(guess.b, problem.names)
        if a != b:
            yield a, b, guess


def _moved(one: Placed, datum: Datum) -> Poses:
    """Into the `map` of another datum; its axes are taken as parallel."""
    assert one.fixes is not None
    own = one.fixes.datum
    return one.start.turned(np.eye(3), datum.enu(own.latitude_deg, own.longitude_deg, own.height_m))


def _hung(known: Keyframes, poses: Poses, other: Placed, guess: Guess) -> Poses:
    """The other session where the guess has it."""
    a, b = (_at(frames, second) for frames, second in ((known, guess.a_s), (other.frames, guess.b_s)))
    there = levelled(poses.rotations[a], poses.positions_m[a]) @ pose_of(guess)
    moved = there @ np.linalg.inv(levelled(other.frames.rotations[b], other.frames.positions_m[b]))
    return other.start.turned(moved[:3, :3], moved[:3, 3])


def _at(frames: Keyframes, second: float) -> int:
    return int(frames.nearest(np.array([frames.stamps_ns[0] + round(second * 1e9)]))[0])
