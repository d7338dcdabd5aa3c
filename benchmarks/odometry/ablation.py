"""The odometry with one choice at a time switched off, over the same walks; prints a table in Markdown.

    python -m benchmarks.odometry.ablation --cache DIR [--seeds 1 2 3] [--scenarios open_trail ...] [--only NAME ...]

APE RMSE after SE(3) alignment, centimetres, mean over the seeds; the last column is the geometric mean over the
scenarios of the ratio to the odometry as it is.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.odometry.run_ours import run
from benchmarks.odometry.simulated import Walk, walk
from drivers.sim.scenarios import scenario
from pipeline.evaluation.trajectory import Trajectory, trajectory_errors
from pipeline.odometry import tracker
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.deskew_kernels import deskew

SCENARIOS = ("open_trail", "thicket", "slope", "meadow_edge", "bicycle", "uav", "shaking")
NEVER = 1e9


@dataclass(frozen=True)
class Variant:
    """settings: dotted names of `OdometryConfig`. patch: done in the process that runs it."""

    name: str
    settings: dict[str, Any] = field(default_factory=dict)
    patch: Callable[[], None] | None = None


def _without_deskewing() -> None:
    def rigid(xyz, time_s, knots, turn, lever):
        return deskew(xyz, np.full_like(time_s, knots[-1, 0]), knots, turn, lever)

    tracker.deskew = rigid


def _with_dust() -> None:
    tracker.DUST_MASK = 0


VARIANTS = (
    Variant("as it is"),
    Variant("the two thinnest directions", {"match.directions": 2}),
    Variant("whole Gaussians: all directions thinner than the voxel", {"match.directions": 3}),
    Variant("point to point (voxel means)", {"match.directions": 3, "match.prior_points": NEVER, "match.wide": NEVER}),
    Variant("wide ones count too", {"match.wide": NEVER}),
    Variant("shapes as measured, no prior for few points", {"match.prior_points": 0.0}),
    Variant("one voxel from all sides", {"map.sides": 1}),
    Variant("stems taken as flat", {"match.round_m": 0.0}),
    Variant("a gyro bias that walks a third as fast", {"imu.gyro_walk_rad_s": 3e-5}),
    Variant("gravity held fixed", {"imu.gravity_walk_rad": 0.0}),
    Variant("every voxel counts alike, however old", {"match.fresh_share": 1.0}),
    Variant("fine grid alone", {"map.sizes_m": (0.3,)}),
    Variant("coarse grid alone (0.6 m)", {"map.sizes_m": (0.6,)}),
    Variant("voxels go on learning", {"map.frozen_points": 1_000_000}),
    Variant("every cluster matched", {"match.most": 1_000_000}),
    Variant("half as many clusters matched", {"match.most": 1250}),
    Variant("no Huber loss", {"match.huber": NEVER}),
    Variant("no gate", {"match.gate": NEVER}),
    Variant("residuals counted as independent", {"match.effective": NEVER}),
    Variant("weak directions not damped", {"degeneracy.attitude_rad": NEVER, "degeneracy.position_m": NEVER}),
    Variant("no deskewing", patch=_without_deskewing),
    Variant("dust tags ignored", patch=_with_dust),
    Variant("gyro and accelerometer taken as exact in scale", {"imu.gyro_share": 0.0, "imu.accel_share": 0.0}),
    Variant("one iteration", {"match.iterations": 1}),
    Variant("half the map", {"map.voxels_most": 350_000}),
)


def main() -> None:
    options = _options()
    walks = [
        (name, walk(scenario(name, seed), options.cache).folder) for name in options.scenarios for seed in options.seeds
    ]
    chosen = [one for one in VARIANTS if not options.only or one.name in (*options.only, VARIANTS[0].name)]
    print("| | " + " | ".join(name.replace("_", " ") for name in options.scenarios) + " | ms | ratio |")
    print("|---" * (len(options.scenarios) + 3) + "|", flush=True)
    usual: dict[str, float] = {}
    for variant in chosen:
        # A process for each variant: patches stay within it.
        with ProcessPoolExecutor(options.processes, max_tasks_per_child=None) as pool:
            scores = list(pool.map(partial(score, variant), [folder for _, folder in walks]))
        apes = {
            name: float(np.mean([ape for (n, _), (ape, _) in zip(walks, scores, strict=True) if n == name]))
            for name in options.scenarios
        }
        usual = usual or apes
        ratio = math.exp(np.mean([math.log(apes[name] / usual[name]) for name in apes]))
        cells = [f"{100.0 * ape:.2f}" for ape in apes.values()]
        print(
            f"| {variant.name} | {' | '.join(cells)} | {np.mean([ms for _, ms in scores]):.1f} | {ratio:.2f} |",
            flush=True,
        )


def score(variant: Variant, folder: Path) -> tuple[float, float]:
    """APE RMSE (m) of one variant on one walk, and its median ms of processor time a scan."""
    if variant.patch is not None:
        variant.patch()
    one = Walk(folder)
    found = list(run(one, configured(variant.settings)))
    stamps, position, quaternion, _ = one.truth()
    truth = Trajectory(stamps, position, Rotation.from_quat(quaternion).as_matrix())
    estimates = [estimate for estimate, _ in found]
    trajectory = Trajectory(
        np.array([one.stamp_ns for one in estimates]),
        np.array([one.position_m for one in estimates]),
        np.array([one.rotation for one in estimates]),
    )
    return trajectory_errors(trajectory, truth, "se3").ape_m.rmse, float(np.median([ms for _, ms in found]))


def configured(settings: dict[str, Any]) -> OdometryConfig:
    """The defaults with some of them changed."""
    table = msgspec.to_builtins(OdometryConfig())
    for dotted, value in settings.items():
        *path, last = dotted.split(".")
        place = table
        for name in path:
            place = place[name]
        if last not in place:
            raise KeyError(f"{dotted} is no setting of the odometry")
        place[last] = value
    return msgspec.convert(table, OdometryConfig)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks are kept")
    parser.add_argument("--scenarios", nargs="+", default=SCENARIOS)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--only", nargs="+", default=[], help="names of variants")
    parser.add_argument("--processes", type=int, default=2)
    return parser.parse_args()


if __name__ == "__main__":
    main()
