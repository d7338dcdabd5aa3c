"""What the odometry drifts by on long walks, and where it comes from.

    python -m benchmarks.odometry.drift --cache DIR [--scenarios loop_1200] [--seeds 1 2 3] [--probe S]

First the yaw that is lost over stretches of the way, and the error beside the way split: what the yaw alone would have
done, and what is left without it; then the height's, what the tilt alone would have done, and the stated sigma. With
`--probe` three runs over the first S seconds instead, in each of which the map is laid down otherwise: where the truth
has it (how well a scan is placed in a perfect map), as always, and turned by a tenth of a degree from half-way on (how
soon the map follows: its age).
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeAlias
from unittest import mock

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.odometry.run_ours import run
from benchmarks.odometry.simulated import SCAN_NS, Walk, walk
from benchmarks.odometry.systems import run as run_system
from drivers.sim.scenarios import scenario
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.voxel_map import VoxelMap

STRETCHES_M = (10, 50, 100, 200)
KICK_RAD = math.radians(0.1)
Doubles: TypeAlias = npt.NDArray[np.float64]
Placed: TypeAlias = Callable[[int, Doubles, Doubles], tuple[Doubles, Doubles]]
"""Of a scan's number and estimated pose: where its points go into the map."""


def main() -> None:
    options = _options()
    heads = [f"yaw over {stretch} m, mdeg" for stretch in STRETCHES_M]
    heads += ["error at the end, m", "by the yaw", "without", "height, m", "by the tilt", "stated"]
    if options.probe:
        heads = ["yaw in a true map: mdeg", "mean of 10 s", "age of the map, s"]
    print(f"| | {' | '.join(heads)} |\n{'|---' * (len(heads) + 1)}|", flush=True)
    for name in options.scenarios:
        for seed in options.seeds:
            one = walk(scenario(name, seed), options.cache)
            cells = _probed(one, options.probe) if options.probe else _lost(one)
            print(f"| {name} {seed} | {' | '.join(cells)} |", flush=True)


def _lost(one: Walk) -> Iterator[str]:
    target = one.folder / "ours_1.npz"
    if not target.exists():
        run_system(one, "ours", target, "")
    found = np.load(target)
    truth, turns = _truth(one, found["stamp_ns"])
    start = turns[0] * Rotation.from_matrix(found["rotation"][0]).inv()
    turn = start * Rotation.from_matrix(found["rotation"]) * turns.inv()
    yaw = np.unwrap(turn.as_euler("ZYX")[:, 0])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(truth, axis=0), axis=1))])
    for stretch in STRETCHES_M:
        later = np.searchsorted(way, way + stretch)
        begun = np.flatnonzero(later < len(way))
        yield f"{_mdeg(np.sqrt(np.mean((yaw[later[begun]] - yaw[begun]) ** 2))):.1f}"
    steps = np.diff(truth, axis=0)
    by_yaw = (Rotation.from_euler("Z", yaw[:-1, None]).apply(steps) - steps).sum(axis=0)
    without = turn[:-1].inv().apply(start.apply(np.diff(found["position"], axis=0))) - steps
    total = start.apply(found["position"] - found["position"][0]) - (truth - truth[0])
    for error in (total[-1], by_yaw, without.sum(axis=0)):
        yield f"{np.linalg.norm(error[:2]):.2f}"
    by_tilt = (turn[:-1].apply(steps) - steps).sum(axis=0)
    for height in (total[-1, 2], by_tilt[2], np.sqrt(found["covariance"][-1, 5, 5])):
        yield f"{height:.2f}"


def _probed(one: Walk, seconds: int) -> Iterator[str]:
    part = Walk(one.folder, seconds)
    stamps = [scan.stamp_ns + SCAN_NS for scan in part.scans()]
    truth, turns = _truth(one, np.array(stamps))
    middle, kick = len(stamps) // 2, Rotation.from_euler("Z", KICK_RAD).as_matrix()
    origin: list[tuple[Doubles, Doubles]] = []

    def true(scan: int, rotation: Doubles, position: Doubles) -> tuple[Doubles, Doubles]:
        if not origin:
            turn = Rotation.from_euler("Z", _yaw(rotation @ turns[scan].as_matrix().T)).as_matrix()
            origin.append((turn, position - turn @ truth[scan]))
        turn, shift = origin[0]
        return turn @ turns[scan].as_matrix(), turn @ truth[scan] + shift

    def kicked(scan: int, rotation: Doubles, position: Doubles) -> tuple[Doubles, Doubles]:
        return (kick @ rotation if scan >= middle else rotation), position

    in_truth = _run(part, true)
    off = np.array([_yaw(r @ t.as_matrix().T) for r, t in zip(in_truth, turns, strict=False)][50:])
    off = _mdeg(off - off.mean())
    yield f"{off.std():.1f}"
    yield f"{off[: len(off) // 100 * 100].reshape(-1, 100).mean(axis=1).std():.1f}"
    usual, other = _run(part, lambda _, rotation, position: (rotation, position)), _run(part, kicked)
    late = (middle + len(usual)) // 2
    pulled = [_yaw(other[k] @ usual[k].T) for k in (late, len(usual) - 1)]
    yield f"{KICK_RAD * (len(usual) - 1 - late) * SCAN_NS * 1e-9 / (pulled[1] - pulled[0]):.1f}"


def _run(one: Walk, placed: Placed) -> list[Doubles]:
    """Rotations (3, 3) of the estimates, with the map laid down elsewhere."""
    insert, rotations = VoxelMap.insert, []

    def laid(grid: VoxelMap, clusters: Doubles, rotation: Doubles, position: Doubles) -> None:
        insert(grid, clusters, *placed(len(rotations), rotation, position))

    with mock.patch.object(VoxelMap, "insert", laid):
        for estimate, _ in run(one, OdometryConfig()):
            rotations.append(estimate.rotation)
    return rotations


def _truth(one: Walk, stamps: npt.NDArray[np.int64]) -> tuple[Doubles, Rotation]:
    """Positions (k, 3) and attitudes (k) at the stamps."""
    t, position, quaternion, _ = one.truth()
    rows = np.clip(np.searchsorted(t, stamps), 0, len(t) - 1)
    return position[rows], Rotation.from_quat(quaternion[rows])


def _yaw(rotation: Doubles) -> float:
    return math.atan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])


def _mdeg(radians: Doubles) -> Doubles:
    return np.degrees(radians) * 1e3


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="where cast walks and results are kept")
    parser.add_argument("--scenarios", nargs="+", default=("loop_1200",))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--probe", type=int, default=0, help="seconds of each walk to look into")
    return parser.parse_args()


if __name__ == "__main__":
    main()
