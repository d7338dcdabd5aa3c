"""Ours, refined and not, beside `rko_lio` and `kiss-slam` over the same walks; prints a table in Markdown.

    python -m benchmarks.refinement.peers --cache DIR --peers-python PY [--results FILE] [--scenarios bicycle]
        [--seeds 1 2 3] [--systems ours refined rko_lio kiss_slam] [--length M]

Without GNSS, which the peers do not take. These run in an environment of their own: `pip install kiss-slam rko_lio`.
APE after SE(3) alignment. A map is the same points for all, laid with each one's poses (`laid.py`); `truth` is what the
true poses make of them. Its figures are those of `evaluate map`. Milliseconds are mean processor time a scan; what is
done in the end is shared out among the scans. Poses that are there, and what stands in the file of results, are not
made again.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.fusion.tracked import tracked
from benchmarks.odometry.simulated import EPOCH_NS, Walk, shortened, walk
from benchmarks.odometry.systems import run, stamps_ns
from benchmarks.refinement.laid import cloud, quality
from benchmarks.refinement.submapped import submaps_of
from drivers.sim.scenarios import WorldConfig, scenario
from drivers.sim.world import build
from pipeline.evaluation.trajectory import Trajectory, aligned, trajectory_errors
from pipeline.gnss.config import FusionConfig
from pipeline.products.track import record_of
from pipeline.refinement.config import RefinementConfig
from pipeline.refinement.refine import refine
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.spread import placement

TRUTH, REFINED = "truth", "refined"
SYSTEMS = ("ours", REFINED, "rko_lio", "kiss_slam")


class Result(msgspec.Struct, frozen=True):
    """Of one system on one walk, in metres. apart: median distance of surfaces seen in passes 30 s apart or more."""

    scenario: str
    seed: int
    system: str
    ape: float
    worst: float
    entropy: float
    plane: float
    surface: float
    bark: float
    apart: float
    ms: float
    note: str


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Poses of `base_link` in the clock of the scans, and mean ms a scan."""

    poses: Trajectory
    ms: float
    note: str = ""


def main() -> None:
    """Print the table."""
    options = _options()
    results = _read(options.results)
    for name in options.scenarios:
        for seed in options.seeds:
            done = {one.system for one in results if (one.scenario, one.seed) == (name, seed)}
            for result in compared(name, seed, options, done):
                results.append(result)
                if options.results is not None:
                    with options.results.open("ab") as file:
                        file.write(msgspec.json.encode(result) + b"\n")
    table(results)


def compared(name: str, seed: int, options: argparse.Namespace, done: set[str]) -> Iterator[Result]:
    """All systems on one walk but those that are done, over the points that every one of them can lay."""
    if not {TRUTH, *options.systems} - done:
        return
    config = shortened(scenario(name, seed), options.length)
    one = walk(config, options.cache)
    truth = _truth(one)
    ways = {system: _way(one, config, system, options) for system in options.systems} | {TRUTH: Way(truth, 0.0)}
    laid = {system: aligned(way.poses, truth.at(way.poses.stamps_ns), "se3") for system, way in ways.items()}
    points = cloud(one, truth, list(laid.values()))
    for system, way in ways.items():
        if system not in done:
            ape = trajectory_errors(laid[system], truth).ape_m
            found = quality(points.laid(laid[system], truth), points.seconds)
            sharp, bark, apart = found.sharpness, found.bark.thickness_m, found.overlap.median_m
            figures = (sharp.entropy, sharp.plane_m, sharp.surface_m, bark, apart, way.ms)
            yield Result(name, seed, system, ape.rmse, ape.worst, *figures, way.note)


def table(results: list[Result]) -> None:
    """In Markdown: centimetres, and millimetres of the map."""
    figures = "entropy | plane mm | of surfaces mm | bark mm | passes apart mm"
    print(f"| scenario | seed | system | APE rmse cm | worst cm | {figures} | ms a scan | |\n" + "| --- " * 12 + "|")
    for one in sorted(results, key=lambda one: (one.scenario, one.seed, (TRUTH, *SYSTEMS).index(one.system))):
        far = [f"{100.0 * value:.2f}" for value in (one.ape, one.worst)]
        near = [f"{1e3 * value:.1f}" for value in (one.plane, one.surface, one.bark, one.apart)]
        cells = [one.scenario, str(one.seed), one.system, *far, f"{one.entropy:.3f}", *near, f"{one.ms:.1f}", one.note]
        print("| " + " | ".join(cells) + " |")


def _truth(one: Walk) -> Trajectory:
    stamps, positions, quaternions, _ = one.truth()
    return Trajectory(stamps, positions, Rotation.from_quat(quaternions).as_matrix())


def _way(one: Walk, config: WorldConfig, system: str, options: argparse.Namespace) -> Way:
    if system == REFINED:
        return _refined(one, config, options)
    target = one.folder / f"{system}_1.npz"
    if not target.exists():
        run(one, system, target, options.peers_python)
    found = np.load(target)
    if not len(found["position"]):
        raise SystemExit(f"{system} made no poses of {one.folder.name} ({found['failed']}); {target} remembers that")
    stamps = stamps_ns(found)
    new = np.diff(stamps, prepend=0) > 0
    poses = Trajectory(stamps, found["position"], found["rotation"]).chosen(new)
    return Way(poses.within(_truth(one)), float(np.mean(found["ms"])), str(found["failed"]))


def _refined(one: Walk, config: WorldConfig, options: argparse.Namespace) -> Way:
    """As `mapforest refine` has it without GNSS: the way of the odometry, its loops closed."""
    odometry = tracked(build(config), options.cache)
    track = np.concatenate([record_of(estimate) for estimate in odometry.estimates])
    submaps = submaps_of(one, odometry.estimates)
    begun = time.process_time()
    (found,) = refine(Problem((Session(track, [], FusionConfig(), submaps),), RefinementConfig()))
    positions, rotations = placement(track, found.solution).poses(track)
    took = 1e3 * (time.process_time() - begun) / len(track)
    poses = Trajectory(track["stamp_ns"].astype(np.int64) + EPOCH_NS, positions, rotations)
    note = f"{len(found.solution.closures)} of {len(found.verdicts)} closures"
    return Way(poses.within(_truth(one)), _way(one, config, "ours", options).ms + took, note)


def _read(path: Path | None) -> list[Result]:
    if path is None or not path.exists():
        return []
    return [msgspec.json.decode(line, type=Result) for line in path.read_bytes().splitlines()]


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks and poses are kept")
    parser.add_argument("--peers-python", default="", help="Python with rko_lio and kiss-slam")
    parser.add_argument("--results", type=Path, help="a file that remembers what is done")
    parser.add_argument("--scenarios", nargs="+", default=["bicycle"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--systems", nargs="+", default=SYSTEMS, choices=SYSTEMS)
    parser.add_argument("--length", type=float, default=None, help="shorten every way to this many metres")
    return parser.parse_args()


if __name__ == "__main__":
    main()
