"""Instead of the fusion: where `odom` lay on the Earth all along the session, as a factor graph has it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec

from edge.process.fusion_stage import FACTS, PLACEMENT, FusionFacts, write_placement
from edge.process.odometry_stage import FIXES, SUBMAPS, TRACK, read_fixes
from pipeline.gnss.config import FusionConfig
from pipeline.products.track import read_track
from pipeline.products.tum import write_tum
from pipeline.refinement.config import RefinementConfig
from pipeline.refinement.constraints import Constraints
from pipeline.refinement.page import write_page
from pipeline.refinement.refine import Refined
from pipeline.refinement.refine import refine as refine_session
from pipeline.refinement.solver import Problem
from pipeline.refinement.spread import corrected, placement
from pipeline.refinement.submaps import read_submaps
from pipeline.refinement.table import write_closures

REFINEMENT, CLOSURES, PAGE, LOCAL = "refinement.json", "closures.csv", "refinement.html", "trajectory_refined.tum"


class RefinementFacts(msgspec.Struct):
    """What was done, for people and programs."""

    software: str
    recording: tuple[tuple[str, int, str], ...]
    """Name, size, digest of each file."""
    config: RefinementConfig
    constraints: Constraints
    keyframes: int = 0
    drift_scale: float = 1.0
    """By which the odometry's own sigmas had to be multiplied."""
    fixes: int = 0
    fixes_used: int = 0
    sigma_scale: tuple[float, ...] = ()
    """By which the receiver's own sigmas had to be multiplied: RTK fixed, float, others."""
    candidates: int = 0
    closures: int = 0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RefinementStage:
    """odometry: the folder of that stage. output: where the list and the page for people go."""

    odometry: Path
    output: Path
    fusion: FusionConfig
    config: RefinementConfig
    constraints: Constraints

    def run(self, folder: Path, facts: RefinementFacts, advance: Callable[[float], None]) -> None:
        """Write the placement in the form of the fusion's. RefinementError."""
        track, fixes = read_track(self.odometry / TRACK), read_fixes(self.odometry / FIXES)
        problem = Problem(track, fixes, self.fusion, self.config, self.constraints)
        found = refine_session(problem, read_submaps(self.odometry / SUBMAPS), advance)
        solved = found.solution
        fused = FusionFacts(fixes=len(fixes), why=_why_not(len(fixes)))
        placed = placement(track, solved)
        if placed is not None:
            write_placement(folder / PLACEMENT, placed)
            fused = FusionFacts(True, "", len(fixes), placed.datum)
        else:
            write_tum(self.output / LOCAL, track["stamp_ns"], *corrected(track, solved))
        (folder / FACTS).write_bytes(msgspec.json.encode(fused))
        write_closures(self.output / CLOSURES, found)
        _count(facts, found)
        write_page(self.output / PAGE, found)
        (self.output / REFINEMENT).write_bytes(msgspec.json.format(msgspec.json.encode(facts), indent=2) + b"\n")


def _count(facts: RefinementFacts, found: Refined) -> None:
    solved = found.solution
    facts.keyframes, facts.drift_scale = len(solved.frames), solved.drift_scale
    if solved.fixes is not None and solved.judged is not None:
        facts.fixes, facts.fixes_used = len(solved.fixes), int(solved.judged.used.sum())
        facts.sigma_scale = tuple(round(scale, 2) for scale in solved.judged.scale.tolist())
    facts.candidates, facts.closures = len(found.verdicts), len(solved.closures)
    facts.notes = tuple(found.notes)


def _why_not(fixes: int) -> str:
    if not fixes:
        return "there are no GNSS fixes in the recording, or they were not asked for"
    return "the fixes were too few, too poor or too close together to tell the heading of the map"
