"""Instead of the fusion: where `odom` lay on the Earth all along the session, as a factor graph has it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from edge.process.fusion_stage import FACTS, PLACEMENT, FusionFacts, write_placement
from edge.process.odometry_stage import FIXES, SUBMAPS, TRACK, read_fixes
from pipeline.gnss.config import FusionConfig
from pipeline.products.track import read_track
from pipeline.refinement.config import RefinementConfig
from pipeline.refinement.constraints import Constraints
from pipeline.refinement.page import write_page
from pipeline.refinement.refine import Refined, refine
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.solver import Solution
from pipeline.refinement.spread import placement
from pipeline.refinement.submaps import read_submaps
from pipeline.refinement.table import write_closures

REFINEMENT, CLOSURES, PAGE = "refinement.json", "closures.csv", "refinement.html"
MADE = (REFINEMENT, CLOSURES, PAGE)


class RefinementFacts(msgspec.Struct):
    """What was done, for people and programs."""

    software: str
    sessions: tuple[str, ...]
    recording: tuple[tuple[str, int, str], ...]
    """Name, size, digest of each file, of one session after the other."""
    config: RefinementConfig
    constraints: Constraints
    keyframes: int = 0
    drift_scale: float = 1.0
    """By which the odometry's own sigmas had to be multiplied."""
    fixes: int = 0
    fixes_used: int = 0
    sigma_scale: tuple[float, ...] = ()
    """By which the receiver's own sigmas had to be multiplied: RTK fixed, float, others, and so for each session."""
    candidates: int = 0
    closures: int = 0
    between_sessions: int = 0
    """Of the closures."""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Given:
    """One session: its recording's name and files, where its odometry lies, and where its placement goes."""

    name: str
    recording: tuple[tuple[str, int, str], ...]
    odometry: Path
    placement: Path
    fusion: FusionConfig

    def session(self) -> Session:
        """As the refinement takes it."""
        track, fixes = read_track(self.odometry / TRACK), read_fixes(self.odometry / FIXES)
        return Session(track, fixes, self.fusion, read_submaps(self.odometry / SUBMAPS), self.name)


def solve(
    given: Sequence[Given], config: RefinementConfig, constraints: Constraints, advance: Callable[[float], None]
) -> list[Refined]:
    """Sessions together as far as they belong together. RefinementError."""
    sessions = tuple(one.session() for one in given)
    return refine(Problem(sessions, config, constraints), advance)


def write_refined(found: Refined, given: Sequence[Given], output: Path, software: str) -> RefinementFacts:
    """The placement of each session in the form of the fusion's; list, page and facts of all for people in `output`."""
    names = found.problem.names
    members = [next(one for one in given if one.name == name) for name in names]
    for number, one in enumerate(members):
        _write_placement(one, found.problem.sessions[number], found.solution.of(number))
    write_closures(output / CLOSURES, found)
    write_page(output / PAGE, found)
    prints = tuple(print_ for one in members for print_ in one.recording)
    facts = RefinementFacts(software, tuple(names), prints, found.problem.config, found.problem.constraints)
    _count(facts, found)
    (output / REFINEMENT).write_bytes(msgspec.json.format(msgspec.json.encode(facts), indent=2) + b"\n")
    return facts


def _write_placement(one: Given, session: Session, solved: Solution) -> None:
    placed, fixes = placement(session.track, solved), len(session.fixes)
    write_placement(one.placement / PLACEMENT, placed)
    fused = FusionFacts(placed.datum is not None, "" if placed.datum else _why_not(fixes), fixes, placed.datum)
    (one.placement / FACTS).write_bytes(msgspec.json.encode(fused))


def _count(facts: RefinementFacts, found: Refined) -> None:
    solved = found.solution
    facts.keyframes, facts.drift_scale = len(solved.frames), solved.drift_scale
    if solved.fixes is not None and solved.judged is not None:
        facts.fixes, facts.fixes_used = len(solved.fixes), int(solved.judged.used.sum())
        facts.sigma_scale = tuple(round(scale, 2) for scale in solved.judged.scale.tolist())
    facts.candidates, facts.closures = len(found.verdicts), len(solved.closures)
    of = solved.frames.session
    facts.between_sessions = sum(int(of[one.a] != of[one.b]) for one in solved.closures)
    facts.notes = tuple(found.notes)


def _why_not(fixes: int) -> str:
    if not fixes:
        return "there are no GNSS fixes in the recording, or they were not asked for"
    return "the fixes were too few, too poor or too close together to tell the heading of the map"
