"""A place passed twice: what is claimed, and what became of the claim."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.estimates import Array


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """Keyframe b as seen from keyframe a, a < b: pose (4, 4). covariance: (6, 6), rotation, then position, axes of b.

    accepted: by the analyst, beyond doubt.
    """

    a: int
    b: int
    pose: Array
    covariance: Array
    accepted: bool = False
