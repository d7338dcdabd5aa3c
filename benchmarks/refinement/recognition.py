"""Places known again by their stems, `map_closures` beside on the same submaps; prints a table in Markdown.

    python -m benchmarks.refinement.recognition [--stands dense open rows] [--seeds 1] [--apart 30]
        [--cache DIR --walks loop_800_1 ...] [--peers-python PY]

Laps in made-up stands, and cast walks with our odometry. Each submap lies about its own middle, turned anyhow, so that
nothing but what it shows tells where it is. Of each one the best proposal counts, on those whose middles are more than
`--apart` metres of way before its own; it is right within 1.5 m, horizontally, and 5 degrees. Found again: of the
submaps that have such an earlier one within 12, or 32 m, those with a right proposal. The peer runs in an environment
of its own: `pip install map_closures`.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.fusion.tracked import tracked
from benchmarks.odometry.simulated import walk as cast
from benchmarks.refinement import synthetic
from benchmarks.refinement.closures import LENGTH_M, RADIUS_M
from benchmarks.refinement.submapped import submaps_of
from drivers.sim.scenarios import scenario
from drivers.sim.world import build
from pipeline.estimates import Array
from pipeline.refinement.config import RecognitionConfig
from pipeline.refinement.recognition import recognise
from pipeline.refinement.session import about_vertical
from pipeline.refinement.stems import place
from pipeline.refinement.submaps import Points, Submap

RIGHT_M, RIGHT_RAD = 1.5, math.radians(5.0)
NEAR_M = (12.0, 32.0)
"""Trees around are the same ones; the rims of what is seen overlap."""
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Submaps, each in a frame of its own. poses: (n, 4, 4) of these frames in truth. way_m: (n,) of their middles."""

    clouds: list[Points]
    poses: Array
    way_m: Array


@dataclass(frozen=True, slots=True, eq=False)
class Claims:
    """Of one system. onto: (k, 2) earlier submap, and the one that lies on it by poses (k, 4, 4)."""

    onto: npt.NDArray[np.int64]
    poses: Array
    ambiguous: int
    seconds: float


def main() -> None:
    options = _options()
    near = " | ".join(f"found again within {reach:g} m" for reach in NEAR_M)
    print(f"| submaps of | system | submaps | proposed | right | ambiguous | {near} | s a submap |")
    print("| --- " * 9 + "|")
    for name, scene in _scenes(options):
        allowed = scene.way_m[None] - scene.way_m[:, None] > options.apart
        print(f"| {name} | ours | {row(scene, allowed, ours(scene, allowed))} |", flush=True)
        if options.peers_python:
            print(f"| {name} | map_closures | {row(scene, allowed, peers(scene, allowed, options.peers_python))} |")


def made(kind: str, seed: int) -> Scene:
    """A lap and a third in a made-up stand."""
    walk = synthetic.rounds(LENGTH_M, RADIUS_M, seed)
    with tempfile.TemporaryDirectory() as folder:
        submaps = synthetic.submaps(walk, synthetic.stand(kind, 60.0, seed), kind, Path(folder), seed)
        middles = [one.middle for one in submaps]
        truth = np.array([walk.true_pose(k) for k in middles])
        track = walk.track[middles]
        return turned(submaps, (track["position_m"], track["rotation"]), truth, track["travelled_m"])


def walked(name: str, seed: int, cache: Path) -> Scene:
    """A cast walk."""
    world = build(scenario(name, seed))
    estimates = tracked(world, cache).estimates
    submaps = submaps_of(cast(world.config, cache), estimates)
    middles = [estimates[one.middle] for one in submaps]
    truth = np.tile(np.eye(4), (len(middles), 1, 1))
    truth[:, :3, 3], truth[:, :3, :3] = world.trajectory.poses(np.array([one.stamp_ns for one in middles]))
    poses = (np.array([one.position_m for one in middles]), np.array([one.rotation for one in middles]))
    return turned(submaps, poses, truth, np.array([one.travelled_m for one in middles]))


def turned(submaps: Sequence[Submap], poses: tuple[Array, Array], truth: Array, way_m: Array) -> Scene:
    """Each about its middle, level, with any heading. poses: of the middles in `odom`, as in truth (n, 4, 4)."""
    random, clouds, frames = np.random.default_rng(0), [], truth.copy()
    for k, (submap, place_m, rotation) in enumerate(zip(submaps, *poses, strict=True)):
        turn = about_vertical(random.uniform(0.0, 2.0 * math.pi))
        clouds.append(((submap.points() - place_m) @ turn.T).astype(np.float32))
        frames[k, :3, :3] = truth[k, :3, :3] @ rotation.T @ turn.T
    return Scene(clouds, frames, way_m)


def ours(scene: Scene, allowed: Mask) -> Claims:
    """By the settings that come with it."""
    place(scene.clouds[0])  # compiled kernels are loaded before the clock runs
    begun = time.process_time()
    found = list(recognise([place(cloud) for cloud in scene.clouds], allowed, RecognitionConfig()))
    seconds = time.process_time() - begun
    best = [some[0] for some in found if some]
    sure = [one for one in best if one.sure]
    onto = np.array([(one.a, one.b) for one in sure], np.int64).reshape(-1, 2)
    poses = np.array([one.pose() for one in sure]).reshape(-1, 4, 4)
    return Claims(onto, poses, len(best) - len(sure), seconds)


def peers(scene: Scene, allowed: Mask, python: str) -> Claims:
    """As it comes; of each submap the closure with the most inliers that is allowed."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "source.npz", Path(folder) / "target.npz"
        np.savez(source, xyz=np.concatenate(scene.clouds), ends=np.cumsum([len(one) for one in scene.clouds]))
        script = Path(__file__).with_name("run_map_closures.py")
        subprocess.run([python, str(script), str(source), str(target)], check=True)
        found = dict(np.load(target))
    onto, rows = found["onto"], np.argsort(-found["inliers"], kind="stable")
    rows = rows[allowed[onto[rows, 0], onto[rows, 1]]]
    rows = rows[np.unique(onto[rows, 1], return_index=True)[1]]
    return Claims(onto[rows], found["poses"][rows], 0, float(found["seconds"]))


def row(scene: Scene, allowed: Mask, claims: Claims) -> str:
    """Figures of one system, as the table has them."""
    places_m = scene.poses[:, :3, 3]
    apart_m = np.linalg.norm(places_m[:, None, :2] - places_m[None, :, :2], axis=2)
    right = {int(b) for (a, b), pose in zip(claims.onto, claims.poses, strict=True) if _right(scene, a, b, pose)}
    counts = [len(scene.clouds), len(claims.onto), len(right), claims.ambiguous]
    found = []
    for reach_m in NEAR_M:
        before = set(np.flatnonzero((allowed & (apart_m < reach_m)).any(axis=0)).tolist())
        found.append(f"{len(right & before)} of {len(before)}")
    return " | ".join([*map(str, counts), *found, f"{claims.seconds / len(scene.clouds):.2f}"])


def _right(scene: Scene, a: int, b: int, pose: Array) -> bool:
    off = np.linalg.inv(np.linalg.inv(scene.poses[a]) @ scene.poses[b]) @ pose
    return bool(np.linalg.norm(off[:2, 3]) < RIGHT_M and abs(math.atan2(off[1, 0], off[0, 0])) < RIGHT_RAD)


def _scenes(options: argparse.Namespace) -> Iterator[tuple[str, Scene]]:
    for kind in options.stands:
        for seed in options.seeds:
            yield f"{kind}_{seed}", made(kind, seed)
    for walk in options.walks:
        name, _, seed = walk.rpartition("_")
        yield walk, walked(name, int(seed), options.cache)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stands", nargs="*", default=["dense", "open", "rows"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1], help="of the stands")
    parser.add_argument("--walks", nargs="*", default=[], help="scenario and seed, as in loop_800_1")
    parser.add_argument("--cache", type=Path, help="where cast walks are kept")
    parser.add_argument("--apart", type=float, default=30.0, help="metres of way")
    parser.add_argument("--peers-python", default="", help="Python with map_closures")
    options = parser.parse_args()
    if options.walks and options.cache is None:
        parser.error("give --cache with --walks")
    return options


if __name__ == "__main__":
    main()
