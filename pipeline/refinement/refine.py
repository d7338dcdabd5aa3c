"""All of it: the open way first, the loops closed by it, and what became of every claim."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from pipeline.refinement.closing import Closing, Place, Verdict
from pipeline.refinement.constraints import check
from pipeline.refinement.proposals import proposals
from pipeline.refinement.registration import Registered
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.solver import Solution, Solver
from pipeline.refinement.starts import groups

_RECOGNISING = 0.1
"""Of the work, if any."""
_SOLVING = 0.2
"""Of the rest; what then remains is registration."""
DOUBTED = "does not agree with GNSS, odometry and the other closures"
_CONTRADICTED = 5.0
"""Sigmas of a pin."""
_GAP_S = 5.0
"""Without poses: longer than the odometry bridges by its inertial samples."""
ROUNDS = 2
"""The second one looks again from where the first one ended: what was too far off to be looked at may now be near."""


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """Sessions that belong together. open: the solution without closures. verdicts: on every candidate; one that was
    believed has no reason, or the analyst's."""

    problem: Problem
    open: Solution
    solution: Solution
    verdicts: tuple[Verdict, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def loose(self) -> list[int]:
        """Sessions that neither fixes nor closures tie to the others."""
        solved, alone = self.solution, len(self.problem.sessions) == 1
        of = solved.frames.session
        tied = {int(of[key]) for one in solved.closures if of[one.a] != of[one.b] for key in (one.a, one.b)}
        tied |= {int(k) for k in ([] if solved.fixes is None else of[solved.fixes.keyframe])}
        return [] if alone else [k for k in range(len(self.problem.sessions)) if k not in tied]


def refine(problem: Problem, advance: Callable[[float], None] = lambda _: None) -> list[Refined]:
    """Sessions together, as far as they belong together; the others each alone, which their notes say. The largest
    group comes first. RefinementError for what cannot be refined, or constraints that cannot be met."""
    check(problem.constraints, {session.name: session.duration_s for session in problem.sessions})
    placed = problem.placed()
    if problem.config.closures.enabled:
        known = proposals(problem.sessions, placed, problem.config, _Share(advance, 0.0, _RECOGNISING))
        problem = replace(problem, recognised=tuple(known))
    if len(problem.sessions) == 1:
        return [_with_doubts(_together(problem, _Share(advance, _RECOGNISING, 1.0 - _RECOGNISING)))]
    parts, done = groups(problem, placed), list[Refined]()
    for k, numbers in enumerate(parts):
        share = (1.0 - _RECOGNISING) / len(parts)
        told = _Share(advance, _RECOGNISING + min(k * share, 1.0 - _RECOGNISING - share), share)
        found = _together(problem.of(numbers), told)
        if loose := [numbers[k] for k in found.loose]:
            tied = [number for number in numbers if number not in loose]
            parts += [tied, *([one] for one in loose)] if tied else [[one] for one in loose]
        else:
            done.append(found)
    return [_with_doubts(_alone(one) if len(one.problem.sessions) == 1 else one) for one in done]


def _together(problem: Problem, advance: Callable[[float], None]) -> Refined:
    solver = Solver(problem)
    first = solved = solver.solve()
    advance(_SOLVING)
    if not problem.config.closures.enabled:
        return Refined(problem, first, first)
    if not any(session.submaps for session in problem.sessions):
        return Refined(problem, first, first, notes=("there are no submaps: no loops were looked for",))
    verdicts, known = list[Verdict](), dict[Place, Registered]()
    for k in range(ROUNDS):
        told = _Share(advance, _SOLVING + k * (1.0 - _SOLVING) / ROUNDS, (1.0 - _SOLVING) / ROUNDS)
        verdicts = Closing(problem, solved, known).verdicts(told)
        solved = solver.solve([one.closure for one in verdicts if one.closure is not None and one.sound])
        if not solved.closures:
            break
    doubted = {(one.a, one.b) for one in solved.doubted}
    verdicts = [replace(one, reason=DOUBTED) if one.sound and _keys(one) in doubted else one for one in verdicts]
    return Refined(problem, first, solved, tuple(verdicts))


def _alone(found: Refined) -> Refined:
    """Says why."""
    name = found.problem.sessions[0].name
    if found.solution.fixes is None:
        why = "GNSS does not place it, and no closure that holds joins it to another; a [[closure]] would"
    else:
        why = f"it does not come within {found.problem.config.closures.most_m:g} m of another session"
    return replace(found, notes=(f"{name} was refined alone: {why}", *found.notes))


def _with_doubts(found: Refined) -> Refined:
    """Says where a recording stops for a while, and which pins the rest does not agree with."""
    notes = [note for session in found.problem.sessions for note in _gaps(session)]
    for pin in found.solution.pins:
        off_m = pin.residual_m(found.solution.poses)
        if off_m > _CONTRADICTED * pin.sigma_m:
            notes.append(
                f"the pin at {pin.at} is missed by {off_m:.2f} m, {off_m / pin.sigma_m:.0f} of its sigmas: it "
                f"contradicts other pins or the trajectory; check its place, its time and arm_m"
            )
    return replace(found, notes=(*notes, *found.notes))


def _gaps(session: Session) -> Iterator[str]:
    stamps = session.track["stamp_ns"].astype(np.int64)
    for k in np.flatnonzero(np.diff(stamps) > _GAP_S * 1e9).tolist():
        after_s, gap_s = (stamps[k] - stamps[0]) / 1e9, (stamps[k + 1] - stamps[k]) / 1e9
        where = f"{session.name}: " if session.name else ""
        yield (
            f"{where}no poses for {gap_s:.0f} s after {after_s:.0f} s: how both parts lie to each other is what "
            f"GNSS and closures say"
        )


def _keys(one: Verdict) -> tuple[int, int] | None:
    return None if one.closure is None else (one.closure.a, one.closure.b)


@dataclass(frozen=True, slots=True)
class _Share:
    """Tells a part of the work as a part of all of it."""

    advance: Callable[[float], None]
    begun: float
    share: float

    def __call__(self, done: float) -> None:
        self.advance(self.begun + self.share * done)
