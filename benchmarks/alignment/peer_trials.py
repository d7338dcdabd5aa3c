"""The clique, and what open3d and small_gicp make of the same pairs in an environment of their own."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.alignment.clique import clique_pose
from benchmarks.alignment.trials import Trial
from pipeline.alignment.cloud import batches, inspect
from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.grid import Grid
from pipeline.alignment.scene import Scene, aerial_scene
from pipeline.alignment.stem_table import read_stems
from pipeline.alignment.transform import Transform, wrapped_deg
from pipeline.evaluation.alignment import AlignmentErrors

Array = npt.NDArray[np.float64]
REACH_M = 20.0
"""A push of 7 m and a turn of 30 degrees at the rim."""
COLUMN_M = 0.5


def clique(aerial: Path, stems: Path, true: Transform) -> Trial:
    """`stems` pushed already."""
    cpu, wall = time.process_time(), time.perf_counter()
    table = read_stems(stems)
    pivot = table.places_m.mean(axis=0)
    fixed = _scene(aerial, pivot)
    found = clique_pose(fixed, table.places_m, table.dbh_cm, pivot, REACH_M)
    errors = None if found is None else _errors(found, true)
    return Trial("stem to crown clique", errors, time.process_time() - cpu, time.perf_counter() - wall)


def peers(python: Path, aerial: Path, ground: Path, trues: list[Transform], folder: Path) -> Iterator[Trial]:
    """Of a table of stems they get columns of points from the ground to the height of the tree."""
    fixed = np.concatenate([batch.xyz_m for batch in batches(inspect(aerial))])
    moved = _columns(aerial, ground) if ground.suffix == ".csv" else _points(ground)
    middle = np.array([*trues[0].pivot_m, float(np.median(fixed[:, 2]))])
    np.savez(folder / "pair.npz", fixed=fixed - middle, moved=moved - middle)
    pushed = [[one.x_m, one.y_m, one.yaw_deg] for one in trues]
    (folder / "pushes.json").write_text(json.dumps(pushed))
    script = Path(__file__).with_name("run_peers.py")
    with subprocess.Popen([python, script, folder], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            told = json.loads(line)
            yield Trial(told["method"], _about_the_middle(told), told["cpu_s"], told["cpu_s"])


def _about_the_middle(told: dict[str, float]) -> AlignmentErrors:
    return AlignmentErrors(float(np.hypot(told["x"], told["y"])), told["z"], told["yaw"], float("nan"), "aligned")


def _errors(found: Transform, true: Transform) -> AlignmentErrors:
    here = np.array([true.inverse().apply(np.array([true.pivot_m]))[0]])
    off = (found.apply(here) - true.apply(here))[0]
    turn = wrapped_deg(found.yaw_deg - true.yaw_deg)
    return AlignmentErrors(float(np.hypot(*off)), float("nan"), turn, float("nan"), "aligned")


def _points(path: Path) -> Array:
    return np.concatenate([batch.xyz_m for batch in batches(inspect(path))])


def _columns(aerial: Path, stems: Path) -> Array:
    rows = np.genfromtxt(stems, delimiter=",", names=True, dtype=None, encoding="utf-8")
    xy, height = np.column_stack([rows["x"], rows["y"]]), np.asarray(rows["h"], float)
    scene = _scene(aerial, xy.mean(axis=0))
    assert scene.terrain_m is not None
    cells, _ = scene.grid.cells(xy)
    ground = scene.terrain_m.ravel()[cells]
    columns = [
        np.column_stack([np.repeat([place], len(up), axis=0), base + up])
        for place, base, up in zip(xy, ground, (np.arange(0, max(h, 1), COLUMN_M) for h in height), strict=True)
    ]
    floor = scene.grid.centres_m().reshape(-1, 2)
    inside = np.all((floor > xy.min(axis=0)) & (floor < xy.max(axis=0)), axis=1)
    return np.concatenate([*columns, np.column_stack([floor[inside], scene.terrain_m.ravel()[inside]])])


def _scene(aerial: Path, middle: Array) -> Scene:
    grid = Grid.over(middle - 60.0, middle + 60.0, AlignmentConfig().cell_m)
    return aerial_scene(lambda: batches(inspect(aerial)), grid)
