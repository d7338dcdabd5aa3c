"""What is to be done for each session, in which order, and what memory it takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from edge.errors import FormatError
from edge.validation.files import recording_files

Stage = Literal["process", "refine", "report"]
STAGES: tuple[Stage, ...] = ("process", "refine", "report")
MIB = 1 << 20
_NEEDS: dict[Stage, tuple[int, float]] = {
    "process": (1024 * MIB, 0.2),
    "refine": (1024 * MIB, 0.5),
    "report": (768 * MIB, 0.2),
}
"""Bytes of any session, and for each byte of the recording: docs/batch.md has what was measured."""


@dataclass(frozen=True, slots=True)
class Step:
    """One stage of one session. memory_bytes: what it may take, an estimate on the safe side.

    refined: the report is on the refined products.
    """

    session: Path
    stage: Stage
    memory_bytes: int
    refined: bool = False

    @property
    def name(self) -> str:
        """Of the session."""
        return self.session.name


def plan(session: Path, *, refine: bool) -> tuple[Step, ...]:
    """The steps of a session, one after the other."""
    size = _size(session)
    wanted = [stage for stage in STAGES if refine or stage != "refine"]
    needs = {stage: base + int(share * size) for stage, (base, share) in _NEEDS.items()}
    return tuple(Step(session, stage, needs[stage], refine and stage == "report") for stage in wanted)


def most_memory(plans: Sequence[Sequence[Step]]) -> int:
    """Of any step."""
    return max(step.memory_bytes for steps in plans for step in steps)


def worker_count(asked: int, sessions: int, needed_bytes: int, there_bytes: int) -> int:
    """At most as many as were asked for, as there are sessions, and as have room for the biggest step; at least one."""
    return max(1, min(asked, sessions, there_bytes // needed_bytes))


def _size(session: Path) -> int:
    """Bytes; 0 of what is no recording, which the first stage will say."""
    try:
        return sum(path.stat().st_size for path in recording_files([session]))
    except (FormatError, OSError):
        return 0
