"""The published ablation, live fusion beside refinement, over seeded walks.

    python -m benchmarks.refinement [--cache DIR] [--seeds 1 2 3] [--walks loop_800 loop_1200] [--drift "0.1 %"]

Mean three-dimensional position error against the truth, global, never aligned: mean and standard deviation over the
walks, and in how many of them the refinement is worse than live. With --cache the real odometry over cast walks, else
one that drifts by numbers. No closures: the walks that are kept hold no submaps.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.fusion.odometry import drifted
from benchmarks.fusion.table import DRIFTS, PLAIN, Walk, followed, received
from benchmarks.fusion.tracked import tracked
from drivers.messages import GnssFix
from drivers.sim.scenarios import scenario
from drivers.sim.world import World, build
from pipeline.estimates import Array
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.geodesy import Datum
from pipeline.products.track import record_of
from pipeline.refinement.config import ChainConfig, GnssConfig, RefinementConfig
from pipeline.refinement.solver import Problem, Solver
from pipeline.refinement.spread import placement

SQUARED = RefinementConfig(ChainConfig(drift_scales=(1.0,)), GnssConfig(kernel="squared", gate=0.0, learn=False))
HUBER = RefinementConfig(ChainConfig(drift_scales=(1.0,)), GnssConfig(gate=0.0, learn=False))
ROWS = (
    ("constant covariance", "honest", FusionConfig(**PLAIN, constant_sigma_m=1.0), SQUARED),
    ("covariance-aware", "honest", FusionConfig(**PLAIN), SQUARED),
    ("all of ours", "honest", FusionConfig(), RefinementConfig()),
    ("all of ours", "dishonest", FusionConfig(), RefinementConfig()),
    ("squared loss", "corrupted", FusionConfig(**PLAIN), SQUARED),
    ("Huber alone", "corrupted", FusionConfig(**PLAIN | {"huber": 1.345}), HUBER),
    ("all of ours", "corrupted", FusionConfig(), RefinementConfig()),
)
EVERY = 5


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, help="where cast walks are kept")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--walks", nargs="+", default=["loop_800", "loop_1200"])
    parser.add_argument("--drift", default="0.1 %", choices=DRIFTS)
    arguments = parser.parse_args()
    walks = []
    for name in arguments.walks:
        for seed in arguments.seeds:
            world = build(scenario(name, seed))
            heard = {preset: received(world, preset, seed) for _, preset, *_ in ROWS}
            odometry = (
                tracked(world, arguments.cache)
                if arguments.cache is not None
                else drifted(world.trajectory, DRIFTS[arguments.drift], seed)
            )
            walks.append(Walk(odometry, _datum(world), heard))
    alone = [float(walk.odometry.alone_m.mean()) for walk in walks]
    print(f"{'':24}{'fixes':11}{'live':>14}{'refined':>14}  worse than live")
    print(f"{'no GNSS, true start':24}{'-':11}{_figures(alone)}{_figures(alone)}")
    for name, preset, fusion, config in ROWS:
        live = [float(followed(walk, walk.fixes[preset], fusion).size_m.mean()) for walk in walks]
        refined = [float(errors_m(walk, walk.fixes[preset], fusion, config).mean()) for walk in walks]
        worse = sum(r > x for r, x in zip(refined, live, strict=True))
        print(f"{name:24}{preset:11}{_figures(live)}{_figures(refined)}  {worse} of {len(walks)}", flush=True)


def errors_m(walk: Walk, fixes: list[GnssFix], fusion: FusionConfig, config: RefinementConfig) -> Array:
    """Of every `EVERY`-th pose."""
    track = np.concatenate([record_of(estimate) for estimate in walk.odometry.estimates])
    placed = placement(track, Solver(Problem(track, fixes, fusion, config)).solve())
    if placed is None:
        raise ValueError("no heading from a whole walk")
    datum, (places, _) = Datum(*placed.datum), placed.poses(track)
    found = np.array([walk.datum.enu(*datum.geodetic(place)) for place in places[::EVERY]])
    return np.linalg.norm(found - walk.odometry.truth_m[::EVERY], axis=1)


def _figures(means: list[float]) -> str:
    return f"{np.mean(means):8.2f} ±{np.std(means):5.2f}"


def _datum(world: World) -> Datum:
    datum = world.config.datum
    return Datum(datum.latitude_deg, datum.longitude_deg, datum.height_m)


if __name__ == "__main__":
    main()
