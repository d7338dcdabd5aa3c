"""Second stage: where `odom` lay on the Earth all along the session, from every fix, forwards and backwards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from drivers.messages import GnssFix
from edge.process.clocks import apart
from edge.process.estimators import Smooth
from edge.process.odometry_stage import FIXES, TRACK, read_fixes
from pipeline.gnss.config import FusionConfig
from pipeline.products.track import Placement, estimate_of, read_track

PLACEMENT, FACTS = "placement.npz", "fusion.json"
_FIT_SHARE = 0.3
"""Of the work; the rest is asking for the poses."""


class FusionFacts(msgspec.Struct):
    """georeferenced: whether there is a `map` at all; why not, otherwise. notes: what is wrong with the fixes."""

    georeferenced: bool = False
    why: str = ""
    fixes: int = 0
    datum: tuple[float, float, float] | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FusionStage:
    """Reads what the odometry left in `odometry`."""

    odometry: Path
    smooth: Smooth
    config: FusionConfig

    def run(self, folder: Path, advance: Callable[[float], None]) -> FusionFacts:
        """Write the placement, unless the fixes cannot tell where the session was."""
        track = read_track(self.odometry / TRACK)
        fixes = read_fixes(self.odometry / FIXES)
        facts = FusionFacts(fixes=len(fixes), why=_why_not(track, fixes, self.config.stamped_late_s))
        if not facts.why:
            facts = self._place(track, fixes, facts, folder, advance)
        (folder / FACTS).write_bytes(msgspec.json.encode(facts))
        return facts

    def _place(
        self,
        track: npt.NDArray[np.void],
        fixes: list[GnssFix],
        facts: FusionFacts,
        folder: Path,
        advance: Callable[[float], None],
    ) -> FusionFacts:
        drift = self.smooth(map(estimate_of, track), fixes, self.config)
        if drift is None:
            facts.why = "the fixes were too few, too poor or too close together to tell the heading of the map"
            return facts
        advance(_FIT_SHARE)
        count = len(track)
        yaw, translation, covariance = np.empty(count), np.empty((count, 3)), np.empty((count, 6, 6))
        for i, record in enumerate(track):
            pose = drift.pose(estimate_of(record))
            turn = pose.rotation @ record["rotation"].T
            yaw[i] = np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
            c, s = np.cos(yaw[i]), np.sin(yaw[i])
            x, y, z = record["position_m"]
            translation[i] = pose.position_enu_m - (c * x - s * y, s * x + c * y, z)
            covariance[i] = pose.covariance
            if i % 500 == 0:
                advance(_FIT_SHARE + (1.0 - _FIT_SHARE) * i / count)
        datum = (drift.datum.latitude_deg, drift.datum.longitude_deg, drift.datum.height_m)
        write_placement(folder / PLACEMENT, Placement.upright(datum, translation, yaw, covariance))
        facts.georeferenced, facts.datum, facts.notes = True, datum, drift.notes
        return facts


def _why_not(track: npt.NDArray[np.void], fixes: list[GnssFix], late_s: float) -> str:
    if not len(track):
        return "there is no odometry"
    if not fixes:
        return "there are no GNSS fixes in the recording, or they were not asked for"
    stamps = np.array([fix.stamp_ns for fix in fixes]) - round(1e9 * late_s)
    off = apart(stamps, track["stamp_ns"])
    return f"of the fixes {off}; fusion.stamped_late_s takes off what they are late" if off else ""


def write_placement(path: Path, placement: Placement) -> None:
    """As a numpy archive."""
    np.savez(
        path,
        datum=np.array(placement.datum or ()),
        translation_m=placement.translation_m,
        rotation=placement.rotation,
        covariance=placement.covariance,
    )


def read_placement(path: Path) -> Placement | None:
    """None where nothing but the odometry tells of the session."""
    if not path.exists():
        return None
    with np.load(path) as found:
        datum = tuple(found["datum"].tolist()) or None
        return Placement(datum, found["translation_m"], found["rotation"], found["covariance"])
