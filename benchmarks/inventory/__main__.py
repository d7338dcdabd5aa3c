"""Stems and diameters on simulated plots, mapped by our own odometry, against those that stand there.

    python -m benchmarks.inventory --cache DIR [--densities open mixed dense] [--seeds 1 2 3 4 5] [--voxel 0.02]
    python -m benchmarks.inventory --real DIR --peers-python PYTHON    real plots, beside dendromatics

A plot is a walk of 45 m, mapped once (a minute) and kept. Completeness: of the stems above 10 cm within 15 m of the
way. Commission: of the stems found within 15 m, those where nothing stands. Diameters: of the matched ones above 10 cm.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.inventory import real
from benchmarks.inventory.plots import DENSITIES, BesideWay, Plot, plot
from pipeline.evaluation.diameters import DiameterErrors, Diameters, diameter_errors, together
from pipeline.inventory.config import InventoryConfig
from pipeline.inventory.inventory import take_inventory
from pipeline.inventory.stem import BREAST_M

WITHIN_M, LEAST_DBH_M = 15.0, 0.10
ROW = "| {} | {} | {} | {} | {:.3f} | {} | {:.3f} | {:.2f} | {:+.2f} | {:.2f} | {:.0%} | {:.0f} |"


def main() -> None:
    options = _options()
    if options.real is not None:
        for row in real.rows(options.real, options.peers_python):
            print(row, flush=True)
        return
    print("| density | seed | stems | found | completeness | made up | MRE | RMSE cm | bias cm | z rms | in 95 % | s |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|", flush=True)
    for density in options.densities:
        every = []
        for seed in options.seeds:
            begun = time.process_time()
            pairs = measured(plot(density, seed, options.cache), options.voxel)
            took = time.process_time() - begun
            every.append(pairs)
            _row(density, str(seed), diameter_errors(pairs, LEAST_DBH_M), took)
        _row(density, "all", diameter_errors(together(every), LEAST_DBH_M), float("nan"))


def measured(one: Plot, voxel_m: float) -> Diameters:
    """What is found within reach of the way beside what stands there, in the frame of the simulated world."""
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
    return Diameters(places[near], said[0][near], said[1][near], true, dbh, wanted)


def _row(density: str, seed: str, e: DiameterErrors, took_s: float) -> None:
    figures = (e.mre, 100 * e.rmse_m, 100 * e.bias_m, e.z_rms, e.within_95, took_s)
    print(ROW.format(density, seed, e.true, e.found, e.completeness, e.made_up, *figures), flush=True)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, help="where mapped walks are kept")
    parser.add_argument("--real", type=Path, metavar="DIR", help="instead: the real plots in a folder")
    parser.add_argument("--peers-python", type=Path, metavar="FILE", help="of an environment with dendromatics")
    parser.add_argument("--densities", nargs="+", default=list(DENSITIES), choices=list(DENSITIES))
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--voxel", type=float, default=0.02, metavar="M", help="the map keeps one point in each cube")
    options = parser.parse_args()
    if (options.cache is None) == (options.real is None) or (options.real is None) != (options.peers_python is None):
        parser.error("give --cache, or --real and --peers-python")
    return options


if __name__ == "__main__":
    main()
