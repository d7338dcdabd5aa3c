"""Every candidate of a closure, as a line: what was measured, and why it was believed or not."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path

from pipeline.refinement.refine import Refined

HEADER = ("a", "a_s", "b", "b_s", "from", "believed", "reason", "apart_m", "sigma_m", "overlap", "rival_m",
          "correction_m", "stems")  # fmt: skip
"""from: `way` (the trajectory brings them near each other), `stems` (known again by these), `analyst`. stems: met, of
those that should be."""


def write_closures(path: Path, found: Refined) -> None:
    """CSV."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(HEADER)
        writer.writerows(rows(found))


def rows(found: Refined) -> Iterator[tuple[str, ...]]:
    """In the order of `HEADER`; empty where nothing was measured."""
    frames, names = found.solution.frames, found.problem.names
    seconds = frames.seconds
    for one in found.verdicts:
        ends = [cell for key in one.keys for cell in (names[frames.session[key]], f"{seconds[key]:.1f}")]
        measured = one.registered
        numbers = [one.candidate.apart_m, one.candidate.sigma_m]
        numbers += [measured.overlap, measured.rival_m, one.correction_m] if measured is not None else [math.nan] * 3
        cells = [f"{number:.3f}" if math.isfinite(number) else "" for number in numbers]
        known = one.candidate.recognised
        stems = f"{known.met} of {known.asked}" if known is not None else ""
        yield (*ends, one.candidate.origin, "yes" if one.sound else "no", one.reason, *cells, stems)
