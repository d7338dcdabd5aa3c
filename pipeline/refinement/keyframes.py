"""The odometry's tracks as chains, one a session: some poses, and how well each is known from the one before."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipeline.estimates import Array
from pipeline.refinement.config import ChainConfig
from pipeline.refinement.errors import NothingToRefine

_LEAST_STEP_M = 0.2
_LOSING_M = 1.0
_LOST = np.array([0.5, 10.0, 10.0, 10.0]) ** 2
"""Variances, as `drifted`, of an odometry that has lost its place: with more, the equations without GNSS cannot be
solved any more, and what ties the parts together outweighs this anyway."""


@dataclass(frozen=True, slots=True, eq=False)
class Keyframes:
    """m poses of one track or several, `base_link` in each one's own `odom`.

    session: (m,) which track, rising. index: (m,) into it. stamps_ns: (m,). positions_m: (m, 3). rotations: (m, 3, 3).
    travelled_m: (m,). drifted: (m, 4) variance of yaw (rad^2), x, y, z (m^2, `odom`) that the odometry gathered on the
    step that led to each; of no meaning for the first of a session.
    """

    session: npt.NDArray[np.int64]
    index: npt.NDArray[np.int64]
    stamps_ns: npt.NDArray[np.int64]
    positions_m: Array
    rotations: Array
    travelled_m: Array
    drifted: Array

    def __len__(self) -> int:
        return len(self.index)

    @property
    def begins(self) -> npt.NDArray[np.int64]:
        """(s,) the first keyframe of each session."""
        return np.flatnonzero(np.diff(self.session, prepend=-1))

    @property
    def steps(self) -> npt.NDArray[np.int64]:
        """(m - s,) the keyframes that have one before them in their session."""
        return np.flatnonzero(np.diff(self.session, prepend=-1) == 0)

    @property
    def seconds(self) -> Array:
        """(m,) since the first pose of each one's session."""
        return np.asarray((self.stamps_ns - self.stamps_ns[self.begins][self.session]) / 1e9)

    @property
    def lost(self) -> npt.NDArray[np.int64]:
        """Of the steps, those on which the odometry lost its place: the parts before and after do not hang together."""
        steps = self.steps
        return np.asarray(steps[self.drifted[steps, 1:3].max(axis=1, initial=0.0) > _LOSING_M**2])

    def step_covariances(self) -> Array:
        """(m, 6, 6) of each pose as seen from the one before: rotation (rad), then position (m), both in the body's
        axes of the later one. Roll and pitch drift no less than yaw does: the odometry's own idea of what is level
        wanders with it."""
        turns = self.rotations
        steps = np.zeros((len(turns), 6, 6))
        steps[:, :3, :3] = self.drifted[:, 0, None, None] * np.eye(3)
        steps[:, 3:, 3:] = np.einsum("kji,kj,kjl->kil", turns, self.drifted[:, 1:], turns)
        return steps

    @property
    def log_spread(self) -> float:
        """Logarithm of the product of all sigmas of all steps."""
        yaw, *moved = np.log(self.drifted[self.steps]).sum(axis=0)
        return 0.5 * float(3.0 * yaw + sum(moved))

    def drifting(self, scale: float) -> Keyframes:
        """The same, with the drift's sigmas so many times larger."""
        return replace(self, drifted=self.drifted * scale**2)

    def of(self, session: int) -> Keyframes:
        """Those of one session, as if it were the only one."""
        mine = self.session == session
        return Keyframes(*(getattr(self, name)[mine] for name in self.__slots__)).numbered(0)

    def numbered(self, session: int) -> Keyframes:
        """Of one session, under another number."""
        return replace(self, session=np.full(len(self), session))

    def nearest(self, stamps_ns: npt.NDArray[np.int64], session: int = 0) -> npt.NDArray[np.int64]:
        """(k,) the keyframe of a session nearest in time to each stamp (k,)."""
        mine = np.flatnonzero(self.session == session)
        own_ns = self.stamps_ns[mine]
        after = np.clip(np.searchsorted(own_ns, stamps_ns), 1, max(len(mine) - 1, 1))
        before = after - 1
        after = np.minimum(after, len(mine) - 1)
        late = stamps_ns - own_ns[before] > own_ns[after] - stamps_ns
        return np.asarray(mine[np.where(late, after, before)])


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """m keyframes in `map`. positions_m: (m, 3). rotations: (m, 3, 3)."""

    positions_m: Array
    rotations: Array

    def turned(self, turn: Array, moved_m: Array) -> Poses:
        """All of them, rigidly: turn (3, 3), then moved_m (3,)."""
        return Poses(self.positions_m @ turn.T + moved_m, turn @ self.rotations)


def keyframes(track: npt.NDArray[np.void], config: ChainConfig, name: str = "") -> Keyframes:
    """Of a track (n,) of ESTIMATE. NothingToRefine where there are fewer than two."""
    index = _chosen(track, config)
    if len(index) < 2:
        of = f"{name}: " if name else ""
        raise NothingToRefine(f"{of}a track of {len(track)} poses that does not move cannot be refined; leave it out")
    chosen = track[index]
    return Keyframes(
        np.zeros(len(index), np.int64),
        index,
        chosen["stamp_ns"].astype(np.int64),
        chosen["position_m"],
        chosen["rotation"],
        chosen["travelled_m"],
        _drifted(chosen, config),
    )


def joined(parts: Sequence[Keyframes]) -> Keyframes:
    """One session after the other."""
    numbered = [part.numbered(k) for k, part in enumerate(parts)]
    return Keyframes(*(np.concatenate([getattr(part, name) for part in numbered]) for name in Keyframes.__slots__))


def _chosen(track: npt.NDArray[np.void], config: ChainConfig) -> npt.NDArray[np.int64]:
    """The first, the last, and one whenever the carrier has moved or turned enough."""
    if not len(track):
        return np.empty(0, np.int64)
    found = [0]
    positions, rotations = track["position_m"], track["rotation"]
    cosine = 1.0 + 2.0 * math.cos(math.radians(config.keyframe_turn_deg))
    for k in range(1, len(track)):
        last = found[-1]
        moved = positions[k] - positions[last]
        turned = float(np.vdot(rotations[last], rotations[k])) < cosine  # the trace of the rotation in between
        if float(moved @ moved) > config.keyframe_m**2 or turned:
            found.append(k)
    if found[-1] != len(track) - 1:
        found.append(len(track) - 1)
    return np.array(found, np.int64)


def _drifted(chosen: npt.NDArray[np.void], config: ChainConfig) -> Array:
    """By how much the odometry's own covariance grew, and no less than the floors.

    The covariance is of the whole way since the start. What an error of yaw at the start of a step swings its end by is
    not new, so that it is taken off.
    """
    drifted = np.ones((len(chosen), 4))
    floor = np.array([math.radians(config.floor_turn_deg), *[config.floor_m] * 3]) ** 2
    known = [_level_covariance(record) for record in chosen]
    for k, (before, after) in enumerate(itertools.pairwise(chosen)):
        moved = after["position_m"] - before["position_m"]
        carry = np.eye(4)
        carry[1, 0], carry[2, 0] = -moved[1], moved[0]
        grown = np.diag(known[k + 1] - carry @ known[k] @ carry.T)
        least = floor * max(float(np.linalg.norm(moved)), _LEAST_STEP_M)
        drifted[k + 1] = np.clip(grown, least, _LOST)
    return drifted


def _level_covariance(record: np.void) -> Array:
    """(4, 4) of yaw about the vertical, and of position, in `odom`."""
    to_level = np.zeros((4, 6))
    to_level[0, 3:] = record["rotation"][2]
    to_level[1:, :3] = np.eye(3)
    return np.asarray(to_level @ record["covariance"] @ to_level.T)
