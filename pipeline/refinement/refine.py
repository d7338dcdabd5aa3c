"""All of it: the open way first, the loops closed by it, and what became of every claim."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pipeline.refinement.closing import Closing, Verdict
from pipeline.refinement.constraints import check
from pipeline.refinement.solver import Problem, Solution, Solver
from pipeline.refinement.submaps import Submap

_SOLVING = 0.2
"""Of the work; the rest is registration."""
DOUBTED = "does not agree with GNSS, odometry and the other closures"
ROUNDS = 2
"""The second one looks again from where the first one ended: what was too far off to be looked at may now be near."""


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """open: the solution without closures. verdicts: on every candidate; one that was believed has no reason, or the
    analyst's."""

    problem: Problem
    open: Solution
    solution: Solution
    verdicts: tuple[Verdict, ...] = ()
    notes: tuple[str, ...] = ()


def refine(problem: Problem, submaps: list[Submap], advance: Callable[[float], None] = lambda _: None) -> Refined:
    """One session. RefinementError for what cannot be refined, or constraints that cannot be met."""
    check(problem.constraints, problem.duration_s)
    solver = Solver(problem)
    first = solved = solver.solve()
    advance(_SOLVING)
    settings = problem.config.closures
    if not settings.enabled:
        return Refined(problem, first, first)
    if not submaps:
        return Refined(problem, first, first, notes=("there are no submaps: no loops were looked for",))
    verdicts: list[Verdict] = []
    for k in range(ROUNDS):
        told = _Share(advance, _SOLVING + k * (1.0 - _SOLVING) / ROUNDS, (1.0 - _SOLVING) / ROUNDS)
        verdicts = Closing(submaps, solved, settings, problem.constraints).verdicts(told)
        solved = solver.solve([one.closure for one in verdicts if one.closure is not None and one.sound])
        if not solved.closures:
            break
    doubted = {(one.a, one.b) for one in solved.doubted}
    verdicts = [replace(one, reason=DOUBTED) if one.sound and _keys(one) in doubted else one for one in verdicts]
    return Refined(problem, first, solved, tuple(verdicts))


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
