"""The published ablation, live fusion beside refinement, over seeded walks.

    python -m benchmarks.refinement --cache DIR [--results FILE] [--seeds 1 2 3] [--walks loop_800 loop_1200] [--rows 7]

Our odometry over cast walks, loops closed. Mean three-dimensional position error against the truth, global, never
aligned: mean and standard deviation over the walks, the worst pose of all, the mean normalised squared error (1 is
honest), and in how many walks the refinement is worse than live. What stands in the file of results is not done again:
take it away when the software has changed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.fusion.table import PLAIN, Errors, Walk, datum_of, followed, received
from benchmarks.fusion.tracked import level, tracked
from benchmarks.odometry.simulated import walk as cast
from benchmarks.refinement.submapped import submaps_of
from drivers.sim.scenarios import scenario
from drivers.sim.world import build
from pipeline.estimates import Array
from pipeline.evaluation.trajectory import normalised_square
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.geodesy import Datum
from pipeline.products.track import record_of
from pipeline.refinement.config import ChainConfig, GnssConfig, RefinementConfig
from pipeline.refinement.refine import refine
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.solver import Solution
from pipeline.refinement.spread import placement

SQUARED = RefinementConfig(ChainConfig(drift_scales=(1.0,)), GnssConfig(kernel="squared", gate=0.0, learn=False))
HUBER = RefinementConfig(ChainConfig(drift_scales=(1.0,)), GnssConfig(gate=0.0, learn=False))
Row = tuple[str, str, FusionConfig, RefinementConfig]
ROWS: tuple[Row, ...] = (
    ("no GNSS, true start", "", FusionConfig(), RefinementConfig()),
    ("constant covariance", "honest", FusionConfig(**PLAIN, constant_sigma_m=1.0), SQUARED),
    ("covariance-aware", "honest", FusionConfig(**PLAIN), SQUARED),
    ("all of ours", "honest", FusionConfig(), RefinementConfig()),
    ("all of ours", "dishonest", FusionConfig(), RefinementConfig()),
    ("squared loss", "corrupted", FusionConfig(**PLAIN), SQUARED),
    ("Huber alone", "corrupted", FusionConfig(**PLAIN | {"huber": 1.345}), HUBER),
    ("all of ours", "corrupted", FusionConfig(), RefinementConfig()),
)
EVERY = 5
NEES = ("live_nees", "nees")


class Result(msgspec.Struct, frozen=True):
    """Errors in metres of one row on one walk; NEES is 0 without fixes."""

    walk: str
    seed: int
    row: str
    fixes: str
    live_mean: float
    live_worst: float
    live_nees: float
    mean: float
    worst: float
    nees: float
    open_mean: float
    """Without closures."""
    closures: int
    candidates: int


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks are kept")
    parser.add_argument("--results", type=Path, help="a file that remembers what is done")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--walks", nargs="+", default=["loop_800", "loop_1200"])
    parser.add_argument("--rows", type=int, nargs="+", default=range(len(ROWS)), help="which to add, from 0")
    arguments = parser.parse_args()
    results = _read(arguments.results)
    for name in arguments.walks:
        for seed in arguments.seeds:
            done = {(one.row, one.fixes) for one in results if (one.walk, one.seed) == (name, seed)}
            wanted = [ROWS[k] for k in arguments.rows if ROWS[k][:2] not in done]
            for result in run(name, seed, arguments.cache, wanted) if wanted else ():
                results.append(result)
                if arguments.results is not None:
                    with arguments.results.open("ab") as file:
                        file.write(msgspec.json.encode(result) + b"\n")
    table([one for one in results if one.walk in arguments.walks and one.seed in arguments.seeds])


def run(name: str, seed: int, cache: Path, rows: Sequence[Row]) -> Iterator[Result]:
    """Some rows of one walk."""
    world = build(scenario(name, seed))
    walk = Walk(
        tracked(world, cache), datum_of(world), {p: received(world, p, seed) for p in {r[1] for r in rows} if p}
    )
    submaps = submaps_of(cast(world.config, cache), walk.odometry.estimates)
    track = np.concatenate([record_of(estimate) for estimate in walk.odometry.estimates])
    _, rotations = world.trajectory.poses(track["stamp_ns"][:1].astype(np.int64))
    turn = level(rotations[0] @ track["rotation"][0].T)
    for row, preset, fusion, config in rows:
        live = followed(walk, walk.fixes[preset], fusion) if preset else alone(walk)
        session = Session(track, walk.fixes[preset] if preset else [], fusion, submaps)
        (found,) = refine(Problem((session,), config))
        refined, opened = (errors(track, solved, walk, turn) for solved in (found.solution, found.open))
        figures = [v for e in (live, refined) for v in (float(e.size_m.mean()), float(e.size_m.max()), e.nees)]
        count = (len(found.solution.closures), len(found.verdicts))
        yield Result(name, seed, row, preset, *figures, float(opened.size_m.mean()), *count)


def alone(walk: Walk) -> Errors:
    """Of the odometry, laid on the truth at the start."""
    return Errors(walk.odometry.alone_m, walk.odometry.alone_m, 0.0)


def errors(track: np.ndarray, solved: Solution, walk: Walk, start: Array) -> Errors:
    """Of every `EVERY`-th pose; by the true pose at the start where there is no `map`. start: (3, 3) of its heading."""
    truth, without, placed = walk.odometry.truth_m[::EVERY], walk.odometry.alone_m[::EVERY], placement(track, solved)
    places, _ = placed.poses(track)
    if placed.datum is None:
        size = np.linalg.norm((places[::EVERY] - places[0]) @ start.T + truth[0] - truth, axis=1)
        return Errors(size, without, 0.0)
    datum = Datum(*placed.datum)
    away = np.array([walk.datum.enu(*datum.geodetic(place)) for place in places[::EVERY]]) - truth
    squared = normalised_square(away, placed.covariance[::EVERY, :3, :3])
    return Errors(np.linalg.norm(away, axis=1), without, float(squared.mean() / 3.0))


def table(results: list[Result]) -> None:
    """In Markdown."""
    means = "live | without closures | refined | worst pose, live | refined | NEES, live | refined"
    print(f"| | fixes | walks | {means} | worse than live | closures |\n" + "| --- " * 12 + "|")
    for name, preset, *_ in ROWS:
        if some := [one for one in results if (one.row, one.fixes) == (name, preset)]:
            means = [_figures([getattr(one, key) for one in some]) for key in ("live_mean", "open_mean", "mean")]
            worst = [f"{max(getattr(one, key) for one in some):.2f}" for key in ("live_worst", "worst")]
            nees = [f"{np.mean([getattr(one, key) for one in some]):.1f}" if preset else "-" for key in NEES]
            worse = f"{sum(one.mean > one.live_mean for one in some)}"
            closures = f"{sum(one.closures for one in some)} of {sum(one.candidates for one in some)}"
            cells = [name, preset or "-", f"{len(some)}", *means, *worst, *nees, worse, closures]
            print("| " + " | ".join(cells) + " |")


def _figures(means: list[float]) -> str:
    return f"{np.mean(means):.3f} ± {np.std(means):.3f}"


def _read(path: Path | None) -> list[Result]:
    if path is None or not path.exists():
        return []
    return [msgspec.json.decode(line, type=Result) for line in path.read_bytes().splitlines()]


if __name__ == "__main__":
    main()
