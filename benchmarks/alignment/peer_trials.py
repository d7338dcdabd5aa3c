"""The clique, and what open3d and small_gicp make of the same pairs in an environment of their own."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.alignment.clique import clique_pose
from benchmarks.alignment.trials import Asked, Case, Trial
from pipeline.alignment.cloud import batches, inspect
from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.grid import Grid
from pipeline.alignment.scene import Scene, aerial_scene, terrestrial_scene
from pipeline.alignment.stem_table import read_stems
from pipeline.alignment.transform import Transform, wrapped_deg
from pipeline.evaluation.alignment import AlignmentErrors

Array = npt.NDArray[np.float64]
REACH_M = 20.0
"""A push of 7 m and a turn of 30 degrees at the rim."""
COLUMN_M = 0.5


def clique(case: Case) -> Trial:
    """Of a table its thickest stems, of a cloud those nearest the middle."""
    cpu = time.process_time()
    stems, rank = _stems(case.ground)
    pivot = stems.mean(axis=0)
    found = clique_pose(_scene(case.aerial, pivot), stems, rank, pivot, REACH_M)
    errors = None if found is None else _errors(found, case.true)
    return Trial(case.pair, "clique", errors, time.process_time() - cpu)


def peers(asked: Asked, pair: str, aerial: Path, ground: Path, trues: Sequence[Transform]) -> Iterator[Trial]:
    """ground: not pushed yet; of a table of stems they get columns as high as the trees. Heights are right already."""
    if not asked.peers:
        return
    assert asked.python is not None
    folder = asked.folder
    fixed = np.concatenate([batch.xyz_m for batch in batches(inspect(aerial))])
    moved = _columns(aerial, ground) if ground.suffix == ".csv" else _points(ground)
    middle = np.array([*trues[0].pivot_m, float(np.median(fixed[:, 2]))])
    np.savez(folder / "pair.npz", fixed=fixed - middle, moved=moved - middle)
    pushed = [[one.x_m, one.y_m, one.yaw_deg] for one in trues]
    (folder / "pushes.json").write_text(json.dumps(pushed))
    script = Path(__file__).with_name("run_peers.py")
    with subprocess.Popen([asked.python, script, folder, *asked.peers], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            told = json.loads(line)
            off = AlignmentErrors(float(np.hypot(told["x"], told["y"])), told["z"], told["yaw"], float("nan"), "")
            yield Trial(pair, told["method"], off, told["cpu_s"])


def _errors(found: Transform, true: Transform) -> AlignmentErrors:
    here = true.inverse().apply(np.array([true.pivot_m]))
    off = (found.apply(here) - true.apply(here))[0]
    turn = wrapped_deg(found.yaw_deg - true.yaw_deg)
    return AlignmentErrors(float(np.hypot(*off)), float("nan"), turn, float("nan"), "")


def _stems(ground: Path) -> tuple[Array, Array]:
    if ground.suffix == ".csv":
        table = read_stems(ground)
        return table.places_m, table.dbh_cm
    cloud = inspect(ground)
    grid = Grid.over(cloud.low_m[:2], cloud.high_m[:2], AlignmentConfig().cell_m)
    scene = terrestrial_scene(lambda: batches(cloud), grid)
    assert scene.stems_m is not None
    return scene.stems_m, -np.linalg.norm(scene.stems_m - scene.stems_m.mean(axis=0), axis=1)


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
    return np.concatenate(columns)


def _scene(aerial: Path, middle: Array) -> Scene:
    grid = Grid.over(middle - 60.0, middle + 60.0, AlignmentConfig().cell_m)
    return aerial_scene(lambda: batches(inspect(aerial)), grid)
