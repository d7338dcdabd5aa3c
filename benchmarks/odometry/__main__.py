"""Ours and its peers over the same walks in the same run; prints a table in Markdown.

    python -m benchmarks.odometry --cache DIR --peers-python PY --genz-python PY [--seeds 1 2 3] [--threads 1]
        [--scenarios open_trail thicket ...] [--systems ours rko_lio ...] [--length M] [--first S]

Peers run in environments of their own: `pip install rko_lio kiss-icp` in one, `pip install genz-lio` in another.
With `--first` all of them see the first seconds of each walk, for the peers that take half a second a scan.
Times are of the processor, not of the clock on the wall: other work on the machine disturbs them less.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.odometry.simulated import Walk, shortened, walk
from benchmarks.odometry.systems import run, stamps_ns
from drivers.sim.scenarios import scenario
from pipeline.evaluation.trajectory import Trajectory, TrajectoryErrors, aligned, trajectory_errors

SCENARIOS = ("open_trail", "thicket", "slope", "meadow_edge", "bicycle", "uav", "shaking", "loop_1200")
SYSTEMS = ("ours", "rko_lio", "rko_lio_fine", "genz_lio", "kiss_icp")
DIVERGED_M = 5.0


@dataclass(frozen=True)
class Score:
    """Of one system on one walk. over_10, over_100: its errors with RPE over so many metres, None without poses."""

    system: str
    finished: bool
    over_10: TrajectoryErrors | None
    over_100: TrajectoryErrors | None
    ms_median: float
    ms_p99: float
    peak_mb: float
    note: str


def main() -> None:
    options = _options()
    print("| scenario | seed | system | APE RMSE cm | worst cm | z cm | RPE 10 m cm | RPE 100 m cm | ms | p99 | MB | |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|", flush=True)
    for name in options.scenarios:
        for seed in options.seeds:
            one = replace(walk(shortened(scenario(name, seed), options.length), options.cache), first_s=options.first)
            for system in options.systems:
                print(f"| {name} | {seed} | {_row(score(one, system, options))} |", flush=True)


def score(one: Walk, system: str, options: argparse.Namespace) -> Score:
    """Run, or take from the cache when asked to, and compare with the truth after SE(3) alignment."""
    target = one.folder / f"{system}_{options.threads}{one.part}.npz"
    if not (options.reuse and target.exists()):
        python = options.genz_python if system.startswith("genz") else options.peers_python
        run(one, system, target, python, options.threads)
    found = np.load(target)
    stamps = stamps_ns(found)
    t, position, quaternion, _ = one.truth()
    inside = (stamps >= t[0]) & (stamps <= t[-1])
    if inside.sum() < 10:
        return Score(system, False, None, None, 0.0, 0.0, 0.0, str(found["failed"]) or "no poses")
    truth = _truth_at(t, position, quaternion, stamps[inside])
    laid = aligned(Trajectory(truth.stamps_ns, found["position"][inside], truth.rotations), truth, "se3")
    laid = Trajectory(truth.stamps_ns, laid.positions_m, truth.rotations)
    over_10 = trajectory_errors(laid, truth, rpe_over_m=10.0)
    done = inside.sum() / one.scan_count
    return Score(
        system,
        bool(done > 0.95 and over_10.ape_m.worst < DIVERGED_M),
        over_10,
        trajectory_errors(laid, truth, rpe_over_m=100.0),
        float(np.median(found["ms"])),
        float(np.percentile(found["ms"], 99)),
        float(found["peak_mb"]),
        str(found["failed"]),
    )


def _truth_at(t: np.ndarray, position: np.ndarray, quaternion: np.ndarray, stamps: np.ndarray) -> Trajectory:
    place = np.column_stack([np.interp(stamps, t, position[:, k]) for k in range(3)])
    nearest = quaternion[np.clip(np.searchsorted(t, stamps), 0, len(t) - 1)]
    return Trajectory(stamps.astype(np.int64), place, Rotation.from_quat(nearest).as_matrix())


def _row(score: Score) -> str:
    state = "" if score.finished else "diverged or ended early "
    time = f"{score.ms_median:.1f} | {score.ms_p99:.1f} | {score.peak_mb:.0f} | {state}{score.note}"
    if score.over_10 is None or score.over_100 is None:
        return f"{score.system} | - | - | - | - | - | {time}"
    ape, near, far = score.over_10.ape_m, score.over_10.rpe_m.rmse, score.over_100.rpe_m.rmse
    centimetres = [ape.rmse, ape.worst, score.over_10.ape_vertical_m.rmse, near, far]
    told = " | ".join("-" if np.isnan(value) else f"{100.0 * value:.2f}" for value in centimetres)
    return f"{score.system} | {told} | {time}"


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks and results are kept")
    parser.add_argument("--peers-python", default="", help="Python with rko_lio and kiss-icp")
    parser.add_argument("--genz-python", default="", help="Python with genz-lio")
    parser.add_argument("--scenarios", nargs="+", default=SCENARIOS)
    parser.add_argument("--systems", nargs="+", default=SYSTEMS, choices=SYSTEMS)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--length", type=float, default=None, help="shorten every way to this many metres")
    parser.add_argument("--first", type=int, default=None, help="so many seconds of each walk only")
    parser.add_argument("--reuse", action="store_true", help="take results that are there instead of running again")
    return parser.parse_args()


if __name__ == "__main__":
    main()
