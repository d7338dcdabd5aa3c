"""One pair of maps, pushed apart by known transforms again and again, and brought together by each method."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
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
    "published": AlignmentConfig(method="nmi"),
    "printed": AlignmentConfig(method="nmi", lobe="absolute"),
}
"""published: with the positive lobe. printed: with the absolute value of equation 2."""


@dataclass(frozen=True, slots=True)
class Asked:
    """Which part of a benchmark. first, count: of the pushes or made-up pairs.

    methods: of `OURS`, and clique. peers: those of `run_peers`, run by python, which has open3d and small_gicp.
    """

    data: Path
    first: int
    count: int
    methods: tuple[str, ...]
    peers: tuple[str, ...]
    python: Path | None
    folder: Path


@dataclass(frozen=True, slots=True)
class Case:
    """A ground map, pushed already to where `true` brings it back from."""

    pair: str
    aerial: Path
    ground: Path
    true: Transform
    overlap: float = AlignmentConfig().overlap


@dataclass(frozen=True, slots=True)
class Trial:
    """errors: None where the method ended without a pose. cpu_s: of all threads."""

    pair: str
    method: str
    errors: AlignmentErrors | None
    cpu_s: float


def pushes(middle_m: Array, first: int, count: int) -> Iterator[Transform]:
    """Shifts evenly over a disc, turns evenly; the k-th is the same in whatever part it is asked for."""
    x, y = middle_m.tolist()
    for k in range(first, first + count):
        out, way, turn = np.random.default_rng([2024, k]).uniform(size=3).tolist()
        out, way = SHIFT_M * np.sqrt(out), 2 * np.pi * way
        yield Transform((x, y), out * np.cos(way), out * np.sin(way), 0.0, TURN_DEG * (2 * turn - 1))


def ours(method: str, case: Case) -> Trial:
    """One of `OURS`."""
    cpu = time.process_time()
    try:
        config = replace(OURS[method], overlap=case.overlap)
        done = run(Task(case.aerial, case.ground, config), lambda _: lambda _: None)
        errors = alignment_errors(result(done, __version__), case.true)
    except AlignmentError:
        errors = None
    return Trial(case.pair, method, errors, time.process_time() - cpu)


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
