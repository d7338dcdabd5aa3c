"""Ours and its peers over the same walks in the same run; prints a table in Markdown.

    python -m benchmarks.odometry --cache DIR --peers-python PY --genz-python PY [--seeds 1 2 3] [--threads 1]
        [--scenarios open_trail thicket ...] [--systems ours rko_lio ...] [--length M]

Peers run in environments of their own: `pip install rko_lio kiss-icp` in one, `pip install genz-lio` in another.
Times are of the processor, not of the clock on the wall: other work on the machine disturbs them less.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.odometry.simulated import EPOCH_NS, IMU_NS, LIDAR_IN_BASE_M, Walk, shortened, walk
from drivers.sim.scenarios import scenario
from pipeline.evaluation.trajectory import Trajectory, TrajectoryErrors, aligned, trajectory_errors

PEERS_START_S = 100.0
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
            one = walk(shortened(scenario(name, seed), options.length), options.cache)
            for system in options.systems:
                print(f"| {name} | {seed} | {_row(score(one, system, options))} |", flush=True)


def score(one: Walk, system: str, options: argparse.Namespace) -> Score:
    """Run, or take from the cache when asked to, and compare with the truth after SE(3) alignment."""
    target = one.folder / f"{system}_{options.threads}.npz"
    if not (options.reuse and target.exists()):
        _run(one, system, target, options)
    found = np.load(target)
    stamps = found["stamp_ns"] if system == "ours" else _host_ns(found["stamps_s"])
    t, position, quaternion, _ = one.truth()
    inside = (stamps >= t[0]) & (stamps <= t[-1])
    if inside.sum() < 10:
        return Score(system, False, None, None, 0.0, 0.0, 0.0, str(found["failed"]) or "no poses")
    truth = _truth_at(t, position, quaternion, stamps[inside])
    # Rotations of peers are not kept: positions alone say where they were.
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


def _run(one: Walk, system: str, target: Path, options: argparse.Namespace) -> None:
    threads = str(options.threads)
    environment = os.environ | {"NUMBA_NUM_THREADS": threads, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": "1"}
    if system == "ours":
        command = [sys.executable, "-m", "benchmarks.odometry.run_ours", str(one.folder), str(target)]
    else:
        python = options.genz_python if system.startswith("genz") else options.peers_python
        script = Path(__file__).with_name("run_peer.py")
        command = [python, str(script), system, str(_exported(one)), str(target), threads]
    ended = subprocess.run(command, env=environment, check=False, capture_output=True, text=True)
    if ended.returncode != 0:
        last = (ended.stderr.strip().splitlines() or [""])[-1]
        nothing = np.empty(0)
        empty = {"stamp_ns": nothing, "stamps_s": nothing, "position": np.empty((0, 3)), "ms": nothing, "peak_mb": 0.0}
        np.savez(target, failed=f"exit {ended.returncode}: {last}", **empty)


def _exported(one: Walk) -> Path:
    path = one.folder / "peer_input.npz"
    if not path.exists():
        scans = list(one.scans())
        imu = np.load(one.folder / "imu.npy")
        np.savez(
            path,
            xyz=np.concatenate([scan.xyz_m for scan in scans]),
            offset_s=np.concatenate([scan.offset_ns * 1e-9 for scan in scans]).astype(np.float32),
            ends=np.cumsum([len(scan.xyz_m) for scan in scans]),
            scan_s=[_peer_s(scan.stamp_ns) for scan in scans],
            imu=np.column_stack([PEERS_START_S + np.arange(len(imu)) * IMU_NS * 1e-9, imu[:, :6]]),
            lever=np.array(LIDAR_IN_BASE_M),
        )
    return path


def _peer_s(stamp_ns: int) -> float:
    return (stamp_ns - EPOCH_NS) * 1e-9 + PEERS_START_S


def _host_ns(stamps_s: np.ndarray) -> np.ndarray:
    return np.round((stamps_s - PEERS_START_S) * 1e9).astype(np.int64) + EPOCH_NS


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
    parser.add_argument("--reuse", action="store_true", help="take results that are there instead of running again")
    return parser.parse_args()


if __name__ == "__main__":
    main()
