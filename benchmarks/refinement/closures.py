"""Which loops are closed, and rightly: dense forest, open forest, and the rows of a plantation as the trap.

    python -m benchmarks.refinement.closures [--stands dense open rows] [--seeds 1 2 3]

A lap and a third without GNSS; the odometry drifts, and says so. Precision: of the closures believed, those within
0.3 m and 1 degree of the truth. Recall: of the submaps at places passed before, those with a closure believed.
Then a false closure, 5 m off, is claimed beside them as surely as the true ones.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.refinement import synthetic
from benchmarks.refinement.synthetic import Walk
from pipeline.gnss.config import FusionConfig
from pipeline.refinement.candidates import keys_of
from pipeline.refinement.closure import Closure
from pipeline.refinement.config import ChainConfig, ClosureConfig, RefinementConfig
from pipeline.refinement.refine import Refined, refine
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.solver import Solution, Solver

RADIUS_M, LENGTH_M = 25.0, 210.0
RIGHT_M, RIGHT_DEG = 0.3, 1.0
FALSE_M = 5.0
CONFIG = RefinementConfig(ChainConfig(drift_scales=(1.0,)), closures=ClosureConfig(each=1))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stands", nargs="+", default=["dense", "open", "rows"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    arguments = parser.parse_args()
    columns = ("stand", "seed", "candidates", "believed", "right", "passed before", "closed", "error, open", "closed")
    print("| " + " | ".join((*columns, "with a lie")) + " |")
    print("| --- " * (len(columns) + 1) + "|")
    for kind in arguments.stands:
        for seed in arguments.seeds:
            with tempfile.TemporaryDirectory() as folder:
                print(f"| {kind} | {seed} | {row(kind, seed, Path(folder))} |", flush=True)


def row(kind: str, seed: int, folder: Path) -> str:
    """Of one walk."""
    walk = synthetic.rounds(LENGTH_M, RADIUS_M, seed)
    submaps = synthetic.submaps(walk, synthetic.stand(kind, 60.0, seed), kind, folder, seed)
    problem = Problem((Session(walk.track, [], FusionConfig(), submaps),), CONFIG)
    (found,) = refine(problem)
    believed = found.solution.closures
    right = [one for one in believed if is_right(one, found, walk)]
    places = walk.positions_m[found.solution.frames.index[keys_of([submaps], found.solution.frames)]]
    again = passed_before(places, found)
    closed = {one.b for one in right}
    keys = keys_of([submaps], found.solution.frames)
    lied = Solver(problem).solve([*believed, lie(found)]) if believed else found.solution
    errors = [f"{error_m(solved, walk):.2f}" for solved in (found.open, found.solution, lied)]
    counts = (len(found.verdicts), len(believed), len(right), len(again), sum(keys[k] in closed for k in again))
    return " | ".join([*map(str, counts), *errors])


def is_right(one: Closure, found: Refined, walk: Walk) -> bool:
    """Within what a registration may err by."""
    a, b = (walk.true_pose(int(found.solution.frames.index[key])) for key in (one.a, one.b))
    off = np.linalg.inv(np.linalg.inv(a) @ b) @ one.pose
    turned = math.degrees(math.acos(min((float(np.trace(off[:3, :3])) - 1.0) / 2.0, 1.0)))
    return bool(np.linalg.norm(off[:3, 3]) < RIGHT_M and turned < RIGHT_DEG)


def passed_before(places_m: np.ndarray, found: Refined) -> list[int]:
    """Submaps with an earlier one so near that they see the same trees."""
    settings = found.problem.config.closures
    least = math.ceil(settings.apart_m / synthetic.STEP_M / 20)
    apart = np.linalg.norm(places_m[:, None] - places_m[None], axis=2)
    return [b for b in range(len(places_m)) if (apart[b, : max(b - least, 0)] < settings.reach_m).any()]


def lie(found: Refined) -> Closure:
    """The last believed closure, somewhere else."""
    true = found.solution.closures[-1]
    pose = true.pose.copy()
    pose[0, 3] += FALSE_M
    return replace(true, pose=pose)


def error_m(solved: Solution, walk: Walk) -> float:
    """Mean over the keyframes, the true start given."""
    frames = solved.frames
    truth = walk.positions_m[frames.index]
    turn = walk.true_pose(int(frames.index[0]))[:3, :3] @ solved.poses.rotations[0].T
    places = (solved.poses.positions_m - solved.poses.positions_m[0]) @ turn.T + truth[0]
    return float(np.linalg.norm(places - truth, axis=1).mean())


if __name__ == "__main__":
    main()
