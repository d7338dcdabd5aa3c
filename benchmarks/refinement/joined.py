"""Sessions without GNSS that nothing but their stems brings together, and an odometry that starts anew half way.

    python -m benchmarks.refinement.joined [--stands dense open rows] [--seeds 1 2]

Two sessions of 100 m on one circle of a made-up stand; and a lap and a third in which the odometry is 69 m off and
turned by 150 degrees from the middle on, and says so. Mean errors, the first pose of the first session given.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.refinement import synthetic
from benchmarks.refinement.closures import CONFIG, LENGTH_M, RADIUS_M
from benchmarks.refinement.synthetic import Walk
from pipeline.gnss.config import FusionConfig
from pipeline.refinement.refine import Refined, refine
from pipeline.refinement.session import Problem, Session, about_vertical
from pipeline.refinement.spread import placement

SESSION_M, LATER_RAD = 100.0, 1.0
LOST_M, LOST_RAD = np.array([60.0, -35.0, 0.5]), math.radians(150.0)
LOST_SIGMA_M, LOST_SIGMA_RAD = 30.0, 2.0


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stands", nargs="+", default=["dense", "open", "rows"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    options = parser.parse_args()
    print("| | stand | seed | in one frame | candidates by stems | closures | mean errors |")
    print("| --- " * 7 + "|")
    for name, walks in (("two sessions", two), ("started anew", restarted)):
        for kind in options.stands:
            for seed in options.seeds:
                print(f"| {name} | {kind} | {seed} | {row(walks(seed), kind, seed)} |", flush=True)


def two(seed: int) -> list[Walk]:
    """The second begins 25 m farther on."""
    others = synthetic.rounds(SESSION_M, RADIUS_M, seed + 10, begin_rad=LATER_RAD)
    return [synthetic.rounds(SESSION_M, RADIUS_M, seed), others]


def restarted(seed: int) -> list[Walk]:
    """One walk, the second half of whose track lies elsewhere."""
    walk = synthetic.rounds(LENGTH_M, RADIUS_M, seed)
    track = walk.track.copy()
    late, turn = track[len(track) // 2 :], about_vertical(LOST_RAD)
    start_m = late["position_m"][0].copy()
    late["position_m"] = (late["position_m"] - start_m) @ turn.T + start_m + LOST_M
    late["rotation"] = turn @ late["rotation"]
    late["covariance"][:, :3, :3] += LOST_SIGMA_M**2 * np.eye(3)
    late["covariance"][:, 5, 5] += LOST_SIGMA_RAD**2
    return [replace(walk, track=track)]


def row(walks: Sequence[Walk], kind: str, seed: int) -> str:
    """Figures of walks in one stand."""
    trunks = synthetic.stand(kind, 60.0, seed)
    with tempfile.TemporaryDirectory() as folder:
        sessions = []
        for k, walk in enumerate(walks):
            submaps = synthetic.submaps(walk, trunks, kind, Path(folder) / str(k), seed + k)
            sessions.append(Session(walk.track, [], FusionConfig(), submaps, f"session {k}"))
        found = refine(Problem(tuple(sessions), CONFIG))
    stems = sum(one.candidate.origin == "stems" for group in found for one in group.verdicts)
    closures = sum(len(group.solution.closures) for group in found)
    joined = len(found) == 1
    errors = " and ".join(f"{error:.2f}" for error in errors_m(found[0], walks)) if joined else "-"
    return f"{'yes' if joined else 'no'} | {stems} | {closures} | {errors}"


def errors_m(found: Refined, walks: Sequence[Walk]) -> list[float]:
    """Mean of each walk's."""
    laid = [placement(walk.track, found.solution.of(k)).poses(walk.track) for k, walk in enumerate(walks)]
    first_m, rotation = laid[0][0][0], laid[0][1][0]
    turn, origin_m = walks[0].true_pose(0)[:3, :3] @ rotation.T, walks[0].positions_m[0]
    places = [(positions - first_m) @ turn.T + origin_m for positions, _ in laid]
    pairs = zip(places, walks, strict=True)
    return [float(np.linalg.norm(place - walk.positions_m, axis=1).mean()) for place, walk in pairs]


if __name__ == "__main__":
    main()
