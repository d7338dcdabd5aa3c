"""Where each stage keeps its files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Places:
    """A folder a stage. `fusion`: of whatever placed the session, in the form of that stage. `moved`: the file that
    tells which points are of what moved, if anybody looked."""

    odometry: Path
    fusion: Path
    detection: Path
    grounding: Path
    moved: Path | None = None

    @classmethod
    def of(cls, work: Path) -> Places:
        """All in the work folder of one recording."""
        return cls(*(work / name for name in ("odometry", "fusion", "detection", "grounding")))
