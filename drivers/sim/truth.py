"""Ground truth of a simulated walk, written for evaluation and never seen by a driver."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from drivers.sim.lidar import LEVER_M
from drivers.sim.scene import Trees
from drivers.sim.species import TRAITS
from drivers.sim.world import World

STEP_NS = 10_000_000
STEM_COLUMNS = (
    *("tree", "species", "scientific_name", "east_m", "north_m", "ground_m", "dbh_m", "height_m"),
    *("lean_east", "lean_north", "crown_radius_m", "clone", "taped"),
)


def write_truth(world: World, folder: Path) -> None:
    """poses.tum, stems.csv and world.json into `folder`, which is made.

    poses.tum: walk time (s), position (m), quaternion x y z w of `base_link` in the world, 100 Hz from t = 0 to rest.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _poses(world, folder / "poses.tum")
    _stems(world, folder / "stems.csv")
    about = asdict(world.config) | {
        "frame": "ENU, origin at the datum, base_link is the IMU",
        "lidar_in_base_m": LEVER_M,
        "duration_ns": world.trajectory.duration_ns,
        "route_m": world.route.length_m,
    }
    (folder / "world.json").write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")


def write_epoch(folder: Path, epoch_ns: int) -> None:
    """epoch.json: the host's monotonic time at t = 0 of poses.tum."""
    (folder / "epoch.json").write_text(json.dumps({"monotonic_ns": epoch_ns}) + "\n", encoding="utf-8")


def _poses(world: World, path: Path) -> None:
    t_ns = np.arange(0, world.trajectory.duration_ns + 1, STEP_NS)
    position, _ = world.trajectory.poses(t_ns)
    rows = np.column_stack([t_ns * 1e-9, position, world.trajectory.quaternions(t_ns)])
    np.savetxt(path, rows, fmt=["%.3f", *["%.6f"] * 3, *["%.9f"] * 4])


def _stems(world: World, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(STEM_COLUMNS)
        writer.writerows(stems_table(world.trees))


def stems_table(trees: Trees) -> Iterator[list[str]]:
    """One row a tree under `STEM_COLUMNS`. dbh_m is across the axis where it is 1.3 m above the ground."""
    for k in range(len(trees)):
        traits = TRAITS[trees.species[k]]
        sizes = (trees.dbh_m[k], trees.height_m[k], *trees.lean[k], trees.crown_radius_m[k])
        numbers = [f"{number:.4f}" for number in (*trees.position_m[k], *sizes)]
        yield [str(k), traits.name, traits.scientific, *numbers, str(trees.clone[k]), str(int(trees.taped[k]))]
