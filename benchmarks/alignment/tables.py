"""Trials as lines of JSON, so that an interrupted run is not lost and parts add up; and as tables."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.alignment.trials import Trial
from pipeline.evaluation.alignment import AlignmentErrors

COLUMNS = (
    "method",
    "runs",
    "found",
    "said aligned, right / wrong",
    "refused",
    "median m",
    "worst m",
    "median °",
    "CPU s",
)


def log(path: Path, one: Trial) -> None:
    """Appends it."""
    errors = None if one.errors is None else msgspec.structs.asdict(one.errors)
    with path.open("a", encoding="utf-8") as file:
        print(json.dumps({"pair": one.pair, "method": one.method, "errors": errors, "cpu_s": one.cpu_s}), file=file)


def read_log(path: Path) -> list[Trial]:
    """What `log` wrote."""
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return [Trial(**row | {"errors": row["errors"] and AlignmentErrors(**row["errors"])}) for row in rows]


def tables(trials: Sequence[Trial]) -> str:
    """One in Markdown a pair, a row a method."""
    return "\n\n".join(
        f"{pair}\n\n" + _table([one for one in trials if one.pair == pair])
        for pair in dict.fromkeys(one.pair for one in trials)
    )


def _table(trials: Sequence[Trial]) -> str:
    rows = ["| " + " | ".join(COLUMNS) + " |", "| --- " + "| ---: " * (len(COLUMNS) - 1) + "|"]
    for method in dict.fromkeys(one.method for one in trials):
        some = [one for one in trials if one.method == method]
        errors = [one.errors for one in some if one.errors is not None]
        metres = [one.horizontal_m for one in errors] or [float("nan")]
        degrees = [abs(one.turn_deg) for one in errors] or [float("nan")]
        judged = [one for one in errors if one.said]
        said = [one for one in judged if one.said == "aligned"]
        verdicts = f"{sum(one.near for one in said)} / {sum(not one.near for one in said)} | {len(some) - len(said)}"
        rows.append(
            f"| {method} | {len(some)} | {sum(one.near for one in errors)} | {verdicts if judged else '- | -'} | "
            f"{np.median(metres):.2f} | {np.max(metres):.2f} | {np.median(degrees):.2f} | "
            f"{np.median([one.cpu_s for one in some]):.2f} |"
        )
    return "\n".join(rows)
