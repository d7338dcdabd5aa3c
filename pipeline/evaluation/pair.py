"""What is compared with what: one trajectory, what it is measured against, and how it may be laid over that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec

from pipeline.evaluation.trajectory import Alignment, Trajectory, TrajectoryErrors, trajectory_errors

ALIGNMENTS: tuple[Alignment, ...] = ("none", "yaw", "se3")


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """A trajectory and the true one, in one clock, and in one frame but for the alignments.

    against: what the other is, where it is not the truth.
    """

    name: str
    estimate: Trajectory
    true: Trajectory
    alignments: tuple[Alignment, ...] = ALIGNMENTS
    against: str = "truth"


class Compared(msgspec.Struct, frozen=True):
    """One trajectory against the truth."""

    trajectory: str
    errors: TrajectoryErrors


def compare(pairs: Sequence[Pair], over_m: float = 100.0) -> list[Compared]:
    """Every trajectory in each of its alignments. over_m: stretches of the RPE."""
    return [
        Compared(pair.name, trajectory_errors(pair.estimate, pair.true, kind, rpe_over_m=over_m))
        for pair in pairs
        for kind in pair.alignments
    ]
