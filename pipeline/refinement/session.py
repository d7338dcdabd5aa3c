"""What is to be refined: one session, or several of one site."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from drivers.messages import GnssFix
from pipeline.gnss.alignment import align
from pipeline.gnss.config import FusionConfig
from pipeline.refinement.config import ChainConfig, RefinementConfig
from pipeline.refinement.constraints import Constraints, Stretch, number_of
from pipeline.refinement.fixes import Fixes, place_fixes
from pipeline.refinement.keyframes import Keyframes, Poses, keyframes
from pipeline.refinement.recognition import Proposal
from pipeline.refinement.submaps import Submap


@dataclass(frozen=True, slots=True, eq=False)
class Session:
    """track: (n,) of ESTIMATE. Without fixes the way begins where it does in `odom`."""

    track: npt.NDArray[np.void]
    fixes: Sequence[GnssFix]
    fusion: FusionConfig
    submaps: Sequence[Submap] = ()
    name: str = ""

    @property
    def duration_s(self) -> float:
        """From the first pose to the last."""
        stamps = self.track["stamp_ns"]
        return float(stamps[-1] - stamps[0]) / 1e9 if len(stamps) else 0.0

    def kept_fixes(self, dropped: Sequence[Stretch]) -> list[GnssFix]:
        """Without the stretches that the analyst dropped."""
        began = int(self.track["stamp_ns"][0]) if len(self.track) else 0
        spans = [(began + round(s.from_s * 1e9), began + round(s.to_s * 1e9)) for s in dropped]
        return [fix for fix in self.fixes if not any(a <= fix.stamp_ns <= b for a, b in spans)]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """All that the refinement is given."""

    sessions: tuple[Session, ...]
    config: RefinementConfig
    constraints: Constraints = field(default_factory=Constraints)
    recognised: tuple[Proposal, ...] = ()
    """Places known again, of these sessions."""

    @property
    def names(self) -> list[str]:
        """Of the sessions, as the constraints call them."""
        return [session.name for session in self.sessions]

    def placed(self) -> list[Placed]:
        """Each session by itself. NothingToRefine."""
        found = []
        for k, session in enumerate(self.sessions):
            drops = [one for one in self.constraints.drop_gnss if number_of(one.session, self.names) == k]
            found.append(place(session, drops, self.config.chain))
        return found

    def of(self, numbers: Sequence[int]) -> Problem:
        """Some of the sessions, and what is said of them alone."""
        sessions = tuple(self.sessions[k] for k in numbers)
        names = {one.name for one in sessions}
        known = tuple(one for one in self.recognised if {one.guess.a, one.guess.b} <= names)
        return Problem(sessions, self.config, self.constraints.about(names), known)


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A session's chain. fixes: None where they do not tell the heading. start: in `map` of the fixes' datum, or else
    in `odom`."""

    frames: Keyframes
    fixes: Fixes | None
    start: Poses


def place(session: Session, dropped: Sequence[Stretch], config: ChainConfig) -> Placed:
    """NothingToRefine where the track does not move."""
    frames = keyframes(session.track, config, session.name)
    kept = session.kept_fixes(dropped)
    fixes = place_fixes(session.track, frames, kept, session.fusion) if kept else None
    start = None if fixes is None else _aligned(frames, fixes, session.fusion)
    if start is None:
        return Placed(frames, None, Poses(frames.positions_m, frames.rotations))
    return Placed(frames, fixes, start)


def _aligned(frames: Keyframes, fixes: Fixes, config: FusionConfig) -> Poses | None:
    """The whole chain turned and moved to the fixes; None where these cannot tell the heading."""
    seconds = fixes.stamps_ns / 1e9
    lasting_s = 2.0 * config.correlation_s
    share = np.diff(seconds, prepend=seconds[0] - lasting_s) / lasting_s if lasting_s else np.ones(len(seconds))
    found = align(fixes.odom_m, fixes.position_m, fixes.sigma_m, np.clip(share, 1e-3, 1.0))
    if not math.degrees(found.yaw_sigma) < config.yaw_known_deg:
        return None
    turn = about_vertical(found.yaw)
    return Poses(frames.positions_m, frames.rotations).turned(turn, found.centre_map_m - turn @ found.centre_odom_m)


def about_vertical(yaw: float) -> npt.NDArray[np.float64]:
    """(3, 3)."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
