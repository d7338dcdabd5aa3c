"""What place recognition proposes: pairs of submaps by their stems, in the words that an analyst would propose them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.estimates import Array
from pipeline.refinement.agreement import agree
from pipeline.refinement.candidates import keys_of
from pipeline.refinement.config import RefinementConfig
from pipeline.refinement.constraints import Guess
from pipeline.refinement.keyframes import Keyframes
from pipeline.refinement.recognition import Proposal, Recognised, recognise
from pipeline.refinement.session import Placed, Session, about_vertical
from pipeline.refinement.stems import place
from pipeline.refinement.submaps import REACH_M

_ADRIFT_M = 150.0
"""Of way without a fix, after which a session may be anywhere."""
_BROKEN_NS, _BROKEN_M = 5_000_000_000, 1.0
"""Time without a pose, and drift of one step, after which the odometry does not know where it is."""
_SEEN_M = 2.0 * REACH_M
"""Of way: places nearer than that see the same trees without having come back."""


def proposals(
    sessions: Sequence[Session],
    placed: Sequence[Placed],
    config: RefinementConfig,
    advance: Callable[[float], None] = lambda _: None,
) -> list[Proposal]:
    """Where the trajectory cannot tell by itself: within sessions that are adrift for a while, and between two of which
    one has no fixes."""
    adrift = [_adrift(one, session) for one, session in zip(placed, sessions, strict=True)]
    if not config.recognition.enabled or not any(adrift) or not any(one.submaps for one in sessions):
        return []
    ends = [
        _End(session, one.frames, key, number)
        for number, (session, one) in enumerate(zip(sessions, placed, strict=True))
        for key in keys_of([session.submaps], one.frames)
    ]
    places = []
    for submap in (submap for session in sessions for submap in session.submaps):
        places.append(place(submap.points()))
        advance(0.5 * len(places) / len(ends))
    found = list[Recognised]()
    for b, some in enumerate(recognise(places, _allowed(ends, placed, adrift), config.recognition)):
        found += some[: config.recognition.each]
        advance(0.5 + 0.5 * (b + 1) / len(ends))
    return [Proposal(_guess(one, ends), one, sum(_agree(one, other, ends) for other in found)) for one in found]


@dataclass(frozen=True, slots=True, eq=False)
class _End:
    """A submap, and the keyframe of its session that it hangs on."""

    session: Session
    frames: Keyframes
    key: int
    number: int

    def pose(self) -> Array:
        """(4, 4) in `odom`, levelled."""
        rotation, found = self.frames.rotations[self.key], np.eye(4)
        found[:3, :3] = about_vertical(math.atan2(rotation[1, 0], rotation[0, 0]))
        found[:3, 3] = self.frames.positions_m[self.key]
        return found


def _adrift(placed: Placed, session: Session) -> bool:
    way_m = placed.frames.travelled_m
    if placed.fixes is None or _pieces(session, placed.frames)[-1]:
        return True
    fixed_m = np.sort(np.concatenate([way_m[placed.fixes.keyframe], way_m[[0, -1]]]))
    return bool(np.diff(fixed_m).max() > _ADRIFT_M)


def _pieces(session: Session, frames: Keyframes) -> npt.NDArray[np.int64]:
    """(m,) how often the odometry was lost before each keyframe."""
    stamps = session.track["stamp_ns"].astype(np.int64)
    gaps = np.cumsum(np.diff(stamps, prepend=stamps[0]) > _BROKEN_NS)
    lost = frames.drifted[:, 1:3].max(axis=1) > _BROKEN_M**2
    lost[0] = False
    return np.asarray(gaps[frames.index] + np.cumsum(lost))


def _allowed(ends: Sequence[_End], placed: Sequence[Placed], adrift: Sequence[bool]) -> npt.NDArray[np.bool_]:
    """(n, n)."""
    number = np.array([end.number for end in ends])
    way_m = np.array([end.frames.travelled_m[end.key] for end in ends])
    blind = np.array([one.fixes is None for one in placed])[number]
    own = number[:, None] == number[None]
    piece = np.array([_pieces(end.session, end.frames)[end.key] for end in ends])
    far = (np.abs(way_m[:, None] - way_m[None]) > _SEEN_M) | (piece[:, None] != piece[None])
    allowed: npt.NDArray[np.bool_] = np.where(own, far & np.array(adrift)[number], blind[:, None] | blind[None])
    return allowed


def _agree(one: Recognised, other: Recognised, ends: Sequence[_End]) -> bool:
    pairs = [(ends[one.a], ends[other.a]), (ends[one.b], ends[other.b])]
    if one.b == other.b or not (one.sure and other.sure) or any(x.number != y.number for x, y in pairs):
        return False
    way_m = sum(abs(float(x.frames.travelled_m[x.key] - y.frames.travelled_m[y.key])) for x, y in pairs)
    return agree(one.pose(), other.pose(), ends[one.b].pose()[:3, 3], way_m)


def _guess(found: Recognised, ends: Sequence[_End]) -> Guess:
    a, b = ends[found.a], ends[found.b]
    seen = np.linalg.inv(a.pose()) @ found.pose() @ b.pose()
    yaw_deg = math.degrees(math.atan2(seen[1, 0], seen[0, 0]))
    x_m, y_m, z_m = seen[:3, 3].tolist()
    a_s, b_s = (float(end.frames.seconds[end.key]) for end in (a, b))
    return Guess(a_s, b_s, x_m, y_m, z_m, yaw_deg, a.session.name, b.session.name)
