"""One pair of maps, pushed apart by known transforms again and again, and brought together by each method."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.alignment.stands import write_las
from edge import __version__
from pipeline.alignment.cloud import batches, inspect
from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.errors import AlignmentError
from pipeline.alignment.result import result
from pipeline.alignment.stem_table import read_stems
from pipeline.alignment.task import Task, run
from pipeline.alignment.transform import Transform
from pipeline.evaluation.alignment import AlignmentErrors, alignment_errors

Array = npt.NDArray[np.float64]
SHIFT_M, TURN_DEG = 7.0, 30.0
OURS = {
    "ours": AlignmentConfig(),
    "nmi, positive lobe": AlignmentConfig(method="nmi"),
    "nmi, |LoG| as printed": AlignmentConfig(method="nmi", lobe="absolute"),
}


@dataclass(frozen=True, slots=True)
class Trial:
    """errors: None where the method ended without a pose. cpu_s: of all threads."""

    method: str
    errors: AlignmentErrors | None
    cpu_s: float
    wall_s: float


def pushes(middle_m: Array, count: int) -> list[Transform]:
    """Shifts evenly over a disc, turns evenly; the same for the same middle."""
    rng = np.random.default_rng(2024)
    out, way = SHIFT_M * np.sqrt(rng.uniform(size=count)), rng.uniform(0, 2 * np.pi, count)
    turns = rng.uniform(-TURN_DEG, TURN_DEG, count)
    x, y = middle_m.tolist()
    moves = zip(out * np.cos(way), out * np.sin(way), turns, strict=True)
    return [Transform((x, y), float(dx), float(dy), 0.0, float(turn)) for dx, dy, turn in moves]


def ours(method: str, aerial: Path, ground: Path, true: Transform, overlap: float = 0.85) -> Trial:
    """`ground` is pushed already."""
    config = OURS[method]
    config = AlignmentConfig(method=config.method, lobe=config.lobe, overlap=overlap)
    cpu, wall = time.process_time(), time.perf_counter()
    try:
        done = run(Task(aerial, ground, config), lambda _: lambda _: None)
        errors = alignment_errors(result(done, __version__), true)
    except AlignmentError:
        errors = None
    return Trial(method, errors, time.process_time() - cpu, time.perf_counter() - wall)


def push_stems(table: Path, into: Path, true: Transform) -> Path:
    """A CSV of stems where `true` has to bring them back from."""
    stems = read_stems(table)
    places = true.inverse().apply(stems.places_m)
    rows = (f"{x:.4f},{y:.4f},{dbh:g}" for (x, y), dbh in zip(places, stems.dbh_cm, strict=True))
    into.write_text("x,y,dbh_cm\n" + "\n".join(rows) + "\n")
    return into


def push_cloud(cloud: Path, into: Path, true: Transform) -> Path:
    """The same of a point cloud, without its coordinate system."""
    xyz = np.concatenate([batch.xyz_m for batch in batches(inspect(cloud))])
    return write_las(into, true.inverse().apply(xyz), None)


def table(trials: Iterable[Trial]) -> str:
    """A row a method, in Markdown."""
    of: dict[str, list[Trial]] = {}
    for one in trials:
        of.setdefault(one.method, []).append(one)
    columns = ("method", "runs", "within 1.5 m and 3°", "said aligned, right / wrong", "refused", "median m", "worst m")
    rows = ["| " + " | ".join((*columns, "median °", "CPU s")) + " |", "| --- " + "| ---: " * 8 + "|"]
    for method, some in of.items():
        errors = [one.errors for one in some if one.errors is not None]
        metres = [one.horizontal_m for one in errors] or [float("nan")]
        degrees = [abs(one.turn_deg) for one in errors] or [float("nan")]
        said = [one for one in errors if one.said == "aligned"]
        near = sum(one.near for one in errors)
        rows.append(
            f"| {method} | {len(some)} | {near} ({near / len(some):.0%}) | "
            f"{sum(one.near for one in said)} / {sum(not one.near for one in said)} | {len(some) - len(said)} | "
            f"{np.median(metres):.2f} | {np.max(metres):.2f} | {np.median(degrees):.2f} | "
            f"{np.median([one.cpu_s for one in some]):.2f} |"
        )
    return "\n".join(rows)


def log(path: Path, name: str, one: Trial) -> None:
    """A line of JSON, so that an interrupted run is not lost."""
    errors = None if one.errors is None else {key: getattr(one.errors, key) for key in one.errors.__struct_fields__}
    with path.open("a", encoding="utf-8") as file:
        print(json.dumps({"pair": name, "method": one.method, "errors": errors, "cpu_s": one.cpu_s}), file=file)
