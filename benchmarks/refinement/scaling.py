"""Time and memory of the graph by length of the way, and what 24 km would take.

    python -m benchmarks.refinement.scaling [--lengths 200 500 1000 2000 5000]

Laps of 200 m with a fix a second and a closure for every ten metres of the later laps, as if registered: a registration
costs the same wherever it is, and is measured by itself. Processor time; the most memory of a process of its own, less
what it needs for nothing.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np

from benchmarks.odometry.run_ours import peak_mb
from benchmarks.refinement import synthetic
from benchmarks.refinement.synthetic import Walk
from pipeline.gnss.config import FusionConfig
from pipeline.refinement.closure import Closure
from pipeline.refinement.config import RefinementConfig
from pipeline.refinement.session import Problem, Session
from pipeline.refinement.solver import Solver

RADIUS_M = 200.0 / (2.0 * math.pi)
EVERY = 5
"""Keyframes, of 2 m each, from one closure to the next."""
FAR_KM = 24.0


def main() -> None:
    """Print the table, then the fit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lengths", type=float, nargs="+", default=[200.0, 500.0, 1000.0, 2000.0, 5000.0])
    parser.add_argument("--one", type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one is not None:
        print(*measured(arguments.one))
        return
    print("| km | keyframes | fixes | closures | s | MB |\n| --- | --- | --- | --- | --- | --- |")
    rows = []
    for length in arguments.lengths:
        command = [sys.executable, "-m", "benchmarks.refinement.scaling", "--one", str(length)]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        rows.append([float(word) for word in said])
        keyframes, fixes, closures, took_s, mb = rows[-1]
        counts = f"{keyframes:.0f} | {fixes:.0f} | {closures:.0f}"
        print(f"| {length / 1e3:g} | {counts} | {took_s:.1f} | {mb:.0f} |", flush=True)
    km = np.array(arguments.lengths) / 1e3
    for name, values in (("s", [row[3] for row in rows]), ("MB", [row[4] for row in rows])):
        power, at_one = np.polyfit(np.log(km), np.log(values), 1)
        far = math.exp(at_one) * FAR_KM**power
        print(f"{name}: {math.exp(at_one):.1f} km^{power:.2f}; {far:.0f} at {FAR_KM:g} km")


def measured(length_m: float) -> tuple[int, int, int, float, float]:
    """Keyframes, fixes, closures, seconds, MB."""
    solve(synthetic.rounds(60.0, RADIUS_M, 1))
    before_mb = peak_mb()
    walk = synthetic.rounds(length_m, RADIUS_M, 1)
    began_s = time.process_time()
    counts = solve(walk)
    return *counts, time.process_time() - began_s, peak_mb() - before_mb


def solve(walk: Walk) -> tuple[int, int, int]:
    """Open, then closed, as `refine` does."""
    problem = Problem((Session(walk.track, synthetic.fixes(walk, 1), FusionConfig()),), RefinementConfig())
    solver = Solver(problem)
    closures = list(claims(walk, solver))
    solved = solver.solve(closures) if closures else solver.solve()
    assert solved.fixes is not None
    return len(solved.frames), len(solved.fixes), len(solved.closures)


def claims(walk: Walk, solver: Solver) -> Iterator[Closure]:
    """Each place of a later lap with the same of the lap before."""
    frames, random = solver.frames, np.random.default_rng(5)
    covariance = np.diag([math.radians(0.15) ** 2] * 3 + [0.03**2] * 3)
    for b in range(0, len(frames), EVERY):
        a = int(np.argmin(np.abs(frames.travelled_m - (frames.travelled_m[b] - 2.0 * math.pi * RADIUS_M))))
        if frames.travelled_m[b] > 2.0 * math.pi * RADIUS_M and a < b:
            poses = [walk.true_pose(int(frames.index[key])) for key in (a, b)]
            pose = np.linalg.inv(poses[0]) @ poses[1]
            pose[:3, 3] += 0.03 * random.standard_normal(3)
            yield Closure(a, b, pose, covariance)


if __name__ == "__main__":
    main()
