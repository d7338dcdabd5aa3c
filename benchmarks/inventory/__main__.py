"""Stems and diameters on simulated plots, mapped by our own odometry, against those that stand there.

    python -m benchmarks.inventory --cache DIR [--densities open mixed dense] [--seeds 1 2 3 4 5] [--refined]
    python -m benchmarks.inventory --real DIR --peers-python PYTHON    real plots, beside dendromatics

A plot is a walk of 45 m, mapped once (a minute) and kept. Completeness: of the stems above 10 cm within 15 m of the
way. Commission: of the stems found within 15 m, those where nothing stands. Diameters: of the matched ones above 10 cm.
Bark: how far the points of a stem stray from it, the median over the stems: how sharp the map is.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.inventory import real
from benchmarks.inventory.plots import DENSITIES, BesideWay, Plot, plot
from pipeline.evaluation.diameters import Diameters, diameter_errors, together
from pipeline.inventory.config import InventoryConfig
from pipeline.inventory.inventory import take_inventory
from pipeline.inventory.stem import BREAST_M

WITHIN_M, LEAST_DBH_M = 15.0, 0.10
ROW = "| {} | {} | {} | {} | {:.3f} | {} | {:.3f} | {:.2f} | {:+.2f} | {:.2f} | {:.0%} | {:.1f} |"
HEAD = "| density | seed | stems | found | completeness | made up | MRE | RMSE cm | bias cm | z rms | 95 % | bark mm |"


def main() -> None:
    options = _options()
    if options.real is not None:
        for row in real.rows(options.real, options.peers_python):
            print(row, flush=True)
        return
    print(HEAD)
    print("|---" * HEAD.count(" |") + "|", flush=True)
    for density in options.densities:
        every = []
        for seed in options.seeds:
            one = plot(density, seed, options.cache)
            if options.refined:
                from benchmarks.inventory.refined import refined  # GTSAM

                one = refined(one, density, seed)
            pairs, bark_m = measured(one, options.voxel)
            every.append((pairs, bark_m))
            _row(density, str(seed), pairs, bark_m)
        pairs = together([pairs for pairs, _ in every])
        _row(density, "all", pairs, float(np.mean([bark_m for _, bark_m in every])))


def measured(one: Plot, voxel_m: float) -> tuple[Diameters, float]:
    """What is found within reach of the way beside what stands there, in the frame of the simulated world; and how far
    points stray from the bark."""
    found = take_inventory(BesideWay(one, voxel_m), InventoryConfig())
    turn, shift = one.into_world()
    axes = np.array([[*s.axis_at(BREAST_M), s.base_m[2] + BREAST_M] for s in found.stems]).reshape(-1, 3)
    places = (axes @ turn.T + shift)[:, :2]
    way = cKDTree(np.load(one.folder / "true_m.npy")[::20, :2])
    near = way.query(places)[0] <= WITHIN_M
    with (one.folder / "truth" / "stems.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    lean = np.array([[float(r["lean_east"]), float(r["lean_north"])] for r in rows])
    true = np.array([[float(r["east_m"]), float(r["north_m"])] for r in rows]) + BREAST_M * lean
    dbh = np.array([float(r["dbh_m"]) for r in rows])
    wanted = way.query(true)[0] <= WITHIN_M
    said = np.array([s.dbh_m for s in found.stems]), np.array([s.dbh_sigma_m for s in found.stems])
    bark_m = float(np.median([s.sigma_m for s, is_near in zip(found.stems, near, strict=True) if is_near]))
    return Diameters(places[near], said[0][near], said[1][near], true, dbh, wanted), bark_m


def _row(density: str, seed: str, pairs: Diameters, bark_m: float) -> None:
    e = diameter_errors(pairs, LEAST_DBH_M)
    figures = (e.mre, 100 * e.rmse_m, 100 * e.bias_m, e.z_rms, e.within_95, 1000 * bark_m)
    print(ROW.format(density, seed, e.true, e.found, e.completeness, e.made_up, *figures), flush=True)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, help="where mapped walks are kept")
    parser.add_argument("--real", type=Path, metavar="DIR", help="instead: the real plots in a folder")
    parser.add_argument("--peers-python", type=Path, metavar="FILE", help="of an environment with dendromatics")
    parser.add_argument("--densities", nargs="+", default=list(DENSITIES), choices=list(DENSITIES))
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--refined", action="store_true", help="on the trajectory that the refinement makes")
    parser.add_argument("--voxel", type=float, default=0.02, metavar="M", help="the map keeps one point in each cube")
    options = parser.parse_args()
    if (options.cache is None) == (options.real is None) or (options.real is None) != (options.peers_python is None):
        parser.error("give --cache, or --real and --peers-python")
    return options


if __name__ == "__main__":
    main()
