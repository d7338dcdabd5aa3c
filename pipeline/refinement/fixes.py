"""Fixes as the graph takes them: which keyframe each one hangs on, how certain it is, and which ones are believed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np
import numpy.typing as npt

from drivers.messages import GnssFix
from pipeline.estimates import Array
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.geodesy import Datum
from pipeline.gnss.history import History
from pipeline.gnss.sighting import Sightings
from pipeline.gnss.trust import KINDS, MEDIAN_CHI2, OTHER
from pipeline.products.track import estimate_of
from pipeline.refinement.config import GnssConfig
from pipeline.refinement.keyframes import Keyframes

KIND_NAMES = ("fixed", "float", "other")
MOST_DISHONEST = 10.0
MEDIAN_CHI2_UP = 0.455
"""Of chi-square with one degree of freedom."""
UP_RATIO = 0.78
"""10.8, the 99.9 % of one degree of freedom, to the 13.8 of two."""


@dataclass(frozen=True, slots=True, eq=False)
class Fixes:
    """f fixes that can be placed. stamps_ns: (f,). keyframe: (f,), the nearest; arm_m: (f, 3) of the antenna, in its
    body. odom_m, position_m: (f, 3) of the antenna in `odom`, and in `map` as the receiver says. sigma_m: (f, 3) before
    any scale. kind: (f,) 0 fixed, 1 float, 2 other, and so on for each session's receiver. white_share: of sigma that
    is new with each fix; the rest lasts for correlation_s, or, where that is 0, there is no rest.
    """

    datum: Datum
    stamps_ns: npt.NDArray[np.int64]
    keyframe: npt.NDArray[np.int64]
    arm_m: Array
    odom_m: Array
    position_m: Array
    sigma_m: Array
    kind: npt.NDArray[np.int64]
    white_share: float
    correlation_s: float

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def kinds(self) -> int:
        """How many there may be."""
        return len(KIND_NAMES) * (int(self.kind.max(initial=0)) // len(KIND_NAMES) + 1)

    def of(self, session: int, frames: Keyframes) -> npt.NDArray[np.bool_]:
        """(f,) which of them hang on keyframes of a session."""
        return np.asarray(frames.session[self.keyframe] == session)

    def seconds(self, frames: Keyframes) -> Array:
        """(f,) since the first pose of each one's session."""
        return np.asarray((self.stamps_ns - frames.stamps_ns[frames.begins][frames.session[self.keyframe]]) / 1e9)

    def seen_from(self, datum: Datum) -> Fixes:
        """The same in the `map` of another datum, whose axes are taken as parallel: 0.01 degrees a kilometre."""
        places = np.array([datum.enu(*self.datum.geodetic(place)) for place in self.position_m])
        return replace(self, datum=datum, position_m=places.reshape(-1, 3))


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """scale: (kinds,) of the sigmas. used: (f,). chi2: (f, 2) of each one's residual, horizontal and vertical."""

    scale: Array
    used: npt.NDArray[np.bool_]
    chi2: Array


def place_fixes(
    track: npt.NDArray[np.void], frames: Keyframes, fixes: Sequence[GnssFix], config: FusionConfig
) -> Fixes | None:
    """None where there is not one that can be used. The datum is the first, as in the fusion."""
    history = History(msgspec.structs.replace(config, history_s=math.inf))
    for record in track:
        history.add(estimate_of(record))
    placing = Sightings(history, config)
    seen = [sighting for sighting in map(placing.place, fixes) if sighting is not None]
    if not seen or placing.datum is None:
        return None
    stamps = np.array([one.passage.stamp_ns for one in seen], np.int64)
    keyframe = frames.nearest(stamps)
    odom_m = np.array([one.passage.antenna_m for one in seen])
    arm_m = np.einsum("fji,fj->fi", frames.rotations[keyframe], odom_m - frames.positions_m[keyframe])
    return Fixes(
        placing.datum,
        stamps,
        keyframe,
        arm_m,
        odom_m,
        np.array([one.position_m for one in seen]),
        np.array([one.sigma_m for one in seen]),
        np.array([KINDS.get(one.quality, OTHER) for one in seen], np.int64),
        config.white_share if config.correlation_s else 1.0,
        config.correlation_s,
    )


def joined_fixes(parts: Sequence[Fixes | None], begins: Sequence[int]) -> Fixes | None:
    """Of several sessions, in the `map` of the first that has any; begins: the first keyframe of each."""
    there = [(k, part) for k, part in enumerate(parts) if part is not None]
    if not there:
        return None
    first = there[0][1]
    moved = [first if part is first else part.seen_from(first.datum) for _, part in there]
    return Fixes(
        first.datum,
        np.concatenate([part.stamps_ns for part in moved]),
        np.concatenate([part.keyframe + begins[k] for k, part in there]),
        np.concatenate([part.arm_m for part in moved]),
        np.concatenate([part.odom_m for part in moved]),
        np.concatenate([part.position_m for part in moved]),
        np.concatenate([part.sigma_m for part in moved]),
        np.concatenate([part.kind + len(KIND_NAMES) * k for k, part in there]),
        first.white_share,
        first.correlation_s,
    )


def judge(fixes: Fixes, residuals_m: Array, config: GnssConfig) -> Judged:
    """By their residuals (f, 3) from the trajectory. Fixes rejected before can come back."""
    scale = np.ones(fixes.kinds)
    chi2 = _chi2(residuals_m, fixes.sigma_m)
    for kind in range(fixes.kinds):
        which = fixes.kind == kind
        if config.learn and which.any():
            typical = max(np.median(chi2[which, 0]) / MEDIAN_CHI2, np.median(chi2[which, 1]) / MEDIAN_CHI2_UP)
            scale[kind] = min(max(math.sqrt(typical), 1.0), MOST_DISHONEST)
    chi2 /= scale[fixes.kind][:, None] ** 2
    if not config.gate:
        return Judged(scale, np.ones(len(fixes), bool), chi2)
    return Judged(scale, (chi2[:, 0] <= config.gate) & (chi2[:, 1] <= UP_RATIO * config.gate), chi2)


def _chi2(residuals_m: Array, sigma_m: Array) -> Array:
    """(f, 2)."""
    whitened = (residuals_m / sigma_m) ** 2
    return np.column_stack([whitened[:, 0] + whitened[:, 1], whitened[:, 2]])
