"""Which step of which session is next, and what became of the others. Knows no cluster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec

from edge.batch.plan import Step
from edge.batch.work import Finished

TRIES = 3
"""Of a step whose worker dies under it."""


class Outcome(msgspec.Struct):
    """What became of a session. done, failed: by stage; the reason is the session's own."""

    session: str
    done: dict[str, Finished] = {}
    failed: dict[str, str] = {}


@dataclass(slots=True)
class _Session:
    left: list[Step]
    step: Step
    outcome: Outcome
    begun: int = 0
    """Times that a worker began with the step; given: times that it was handed out."""
    given: int = 1


class Schedule:
    """The steps of each session one after the other; each method that ends one says what the session does next."""

    def __init__(self, plans: Sequence[Sequence[Step]]) -> None:
        self._sessions = {str(first.session): _session(first, rest) for first, *rest in plans}

    def first(self) -> list[Step]:
        """Of each session."""
        return [one.step for one in self._sessions.values()]

    def outcomes(self) -> list[Outcome]:
        """In the order of the plans."""
        return [one.outcome for one in self._sessions.values()]

    def current(self, session: str, stage: str) -> Step | None:
        """The session's step, if it is still at that stage."""
        one = self._sessions.get(session)
        return one.step if one is not None and one.step.stage == stage else None

    def began(self, step: Step) -> int:
        """A worker took it: for which time."""
        one = self._sessions[str(step.session)]
        one.begun += 1
        return one.begun

    def done(self, step: Step, finished: Finished) -> Step | None:
        """The next stage, if there is one."""
        one = self._sessions[str(step.session)]
        one.outcome.done[step.stage] = finished
        return self._go_on(one)

    def failed(self, step: Step, reason: str) -> Step | None:
        """Nothing follows; but without refinement there is still something to report."""
        one = self._sessions[str(step.session)]
        one.outcome.failed[step.stage] = reason
        one.left = [replace(following, refined=False) for following in one.left if step.stage == "refine"]
        return self._go_on(one)

    def died(self, step: Step) -> Step | None:
        """`TRIES` workers ended while the step was theirs: again if it only waited there, as Dask counts both alike.

        Each session that ends workers can take the patience with one that waits once: so often it is handed out.
        """
        one = self._sessions[str(step.session)]
        if one.begun >= TRIES or one.given > len(self._sessions):
            return None
        one.given += 1
        return step

    @staticmethod
    def _go_on(one: _Session) -> Step | None:
        if not one.left:
            return None
        one.step, one.begun, one.given = one.left.pop(0), 0, 1
        return one.step


def _session(first: Step, rest: list[Step]) -> _Session:
    return _Session(rest, first, Outcome(str(first.session)))
