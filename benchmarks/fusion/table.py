"""The published table, with our odometry over cast walks, and with one that drifts by numbers.

    python -m benchmarks.fusion.table --cache DIR [--seeds 1 2 3] [--walks loop_800 loop_1200] [--drifts "0.4 %"]

Position error against the truth, three-dimensional, global, never aligned. Without GNSS the true pose at the start is
given for nothing. Live: from when the yaw is known; offline: the whole walk. "Worse than none": seeds in which the
mean error is above the one without GNSS over the same poses.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.fusion.odometry import Drift, Odometry, drifted
from benchmarks.fusion.tracked import tracked
from drivers.messages import FixQuality, GnssFix
from drivers.sim.gnss import ReceiverModel
from drivers.sim.gnss_errors import PRESETS
from drivers.sim.scenarios import scenario
from drivers.sim.world import World, build
from pipeline.estimates import Array, GlobalPose
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.fusion import GnssFusion
from pipeline.gnss.geodesy import Datum
from pipeline.gnss.smoother import smooth

DRIFTS = {
    "0.1 %": Drift(share=0.003, yaw_deg=0.01),
    "0.4 %": Drift(share=0.010, yaw_deg=0.03),
    "1 %": Drift(share=0.020, yaw_deg=0.05),
}
PLAIN = {
    "huber": math.inf,
    "gate": math.inf,
    "learning_rate": 0.0,
    "correlation_s": 0.0,
    "drift_scales": (1.0,),
    "sigma_floor_m": (0.01, 0.01, 0.01),
}
ROWS = (
    ("constant covariance", "honest", FusionConfig(**PLAIN, constant_sigma_m=1.0)),
    ("covariance-aware", "honest", FusionConfig(**PLAIN)),
    ("all of ours", "honest", FusionConfig()),
    ("all of ours", "dishonest", FusionConfig()),
    ("squared loss", "corrupted", FusionConfig(**PLAIN)),
    ("Huber alone", "corrupted", FusionConfig(**PLAIN | {"huber": 1.345})),
    ("all of ours", "corrupted", FusionConfig()),
    ("without Huber", "corrupted", FusionConfig(huber=math.inf)),
    ("without gate", "corrupted", FusionConfig(gate=math.inf)),
    ("without learned sigmas", "dishonest", FusionConfig(learning_rate=0.0)),
    ("without floors", "dishonest", FusionConfig(sigma_floor_m=(0.01, 0.01, 0.01))),
    ("white errors", "corrupted", FusionConfig(correlation_s=0.0)),
    ("one drift", "corrupted", FusionConfig(drift_scales=(1.0,))),
)
FIX_NS = 200_000_000
DELAY_NS = 120_000_000
"""From measurement to arrival."""
EVERY = 5


@dataclass(frozen=True, slots=True)
class Walk:
    """One seeded traverse. fixes: by preset."""

    odometry: Odometry
    datum: Datum
    fixes: dict[str, list[GnssFix]]


@dataclass(frozen=True, slots=True)
class Errors:
    """Per pose: size (m) with GNSS, and without over the same poses. nees: for each degree of freedom; 1 is honest."""

    size_m: Array
    without_m: Array
    nees: float


def main() -> None:
    """Print the table, one block a drift."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, help="where cast walks are kept; without it synthetic odometry alone")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--walks", nargs="+", default=["loop_800", "loop_1200"])
    parser.add_argument("--drifts", nargs="*", default=list(DRIFTS), choices=DRIFTS)
    arguments = parser.parse_args()
    places = [(name, seed) for name in arguments.walks for seed in arguments.seeds]
    worlds = [(build(scenario(name, seed)), seed) for name, seed in places]
    fixes = [{preset: received(world, preset, seed) for preset in PRESETS} for world, seed in worlds]
    if arguments.cache is not None:
        _block(
            "our odometry",
            [
                Walk(tracked(world, arguments.cache), datum_of(world), heard)
                for (world, _), heard in zip(worlds, fixes, strict=True)
            ],
        )
    for label in arguments.drifts:
        _block(
            f"odometry that drifts by {label} of the way",
            [
                Walk(drifted(world.trajectory, DRIFTS[label], seed), datum_of(world), heard)
                for (world, seed), heard in zip(worlds, fixes, strict=True)
            ],
        )


def _block(label: str, walks: list[Walk]) -> None:
    alone = [walk.odometry.alone_m for walk in walks]
    share = np.mean([walk.odometry.end_error_m / walk.odometry.estimates[-1].travelled_m for walk in walks])
    print(f"\n{label} ({100 * share:.2f} % of the way off at the end)")
    sizes = f"{'rmse':>7}{'max':>7}"
    heads = f"{'live mean':>10}{sizes}{'nees':>6}   {'off. mean':>10}{sizes}{'nees':>8}"
    print(f"{'':24}{'fixes':11}{heads}  worse than none")
    print(f"{'no GNSS':24}{'-':11}{_figures(alone)}{'':9}{_figures(alone)}")
    for name, preset, config in ROWS:
        live = [followed(walk, walk.fixes[preset], config) for walk in walks]
        offline = [smoothed(walk, walk.fixes[preset], config) for walk in walks]
        worse = [sum(e.size_m.mean() > e.without_m.mean() for e in errors) for errors in (live, offline)]
        print(
            f"{name:24}{preset:11}{_figures(e.size_m for e in live)}{np.mean([e.nees for e in live]):6.1f}   "
            f"{_figures(e.size_m for e in offline)}{np.mean([e.nees for e in offline]):8.1f}"
            f"  live {worse[0]}, offline {worse[1]} of {len(walks)}",
            flush=True,
        )


def _figures(walks: Iterable[Array]) -> str:
    """Mean over the walks of each walk's mean and RMSE; the largest of all."""
    sizes = list(walks)
    mean = np.mean([size.mean() for size in sizes])
    rmse = np.mean([np.sqrt(np.mean(size**2)) for size in sizes])
    return f"{mean:10.2f}{rmse:7.2f}{max(size.max() for size in sizes):7.2f}"


def received(world: World, preset: str, seed: int) -> list[GnssFix]:
    """The fixes of a whole walk at 5 Hz."""
    receiver = ReceiverModel(world.antenna, replace(PRESETS[preset], seed=seed), world.config.datum)
    fixes = []
    for stamp in range(0, world.trajectory.duration_ns, FIX_NS):
        epoch = receiver.epoch(stamp)
        if epoch is not None:
            place = (epoch.latitude_deg, epoch.longitude_deg, epoch.height_m, epoch.geoid_separation_m)
            quality = (epoch.satellites, epoch.hdop, epoch.age_s, epoch.sigma_enu_m, "gst")
            fixes.append(GnssFix(stamp, stamp + DELAY_NS, 0, False, FixQuality(epoch.quality), *place, *quality))
    return fixes


def followed(walk: Walk, fixes: list[GnssFix], config: FusionConfig) -> Errors:
    """The live fusion."""
    fusion, waiting, poses = GnssFusion(config), iter(fixes), []
    fix = next(waiting, None)
    for k, estimate in enumerate(walk.odometry.estimates):
        fusion.add_odometry(estimate)
        while fix is not None and fix.receive_ns <= estimate.stamp_ns:
            fusion.add_fix(fix)
            fix = next(waiting, None)
        pose = fusion.global_pose(estimate) if k % EVERY == 0 else None
        state = fusion.state() if pose is not None else None
        if pose is not None and state is not None and state.datum is not None:
            poses.append((k, pose, Datum(*state.datum)))
    return _errors(walk, poses)


def smoothed(walk: Walk, fixes: list[GnssFix], config: FusionConfig) -> Errors:
    """The same after the session."""
    drift = smooth(walk.odometry.estimates, fixes, config)
    if drift is None:
        raise ValueError("no yaw from a whole walk")
    estimates = walk.odometry.estimates
    return _errors(walk, [(k, drift.pose(estimates[k]), drift.datum) for k in range(0, len(estimates), EVERY)])


def _errors(walk: Walk, poses: list[tuple[int, GlobalPose, Datum]]) -> Errors:
    errors, nees = [], []
    for k, pose, datum in poses:
        error = walk.datum.enu(*datum.geodetic(pose.position_enu_m)) - walk.odometry.truth_m[k]
        errors.append(float(np.linalg.norm(error)))
        nees.append(float(error @ np.linalg.solve(pose.covariance[:3, :3], error)))
    return Errors(np.array(errors), walk.odometry.alone_m[[k for k, _, _ in poses]], float(np.mean(nees)) / 3.0)


def datum_of(world: World) -> Datum:
    datum = world.config.datum
    return Datum(datum.latitude_deg, datum.longitude_deg, datum.height_m)


if __name__ == "__main__":
    main()
