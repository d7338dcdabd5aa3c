"""Maps of the same points, laid with somebody's poses, so that nothing but the poses makes a difference.

Each point is brought to the time of its sweep's pose by the true motion, and from there to where the pose puts it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
import numpy.typing as npt

from benchmarks.odometry.simulated import EPOCH_NS, LIDAR_IN_BASE_M, SCAN_NS, Walk
from benchmarks.refinement.submapped import KNOT_NS, NEAREST_M
from pipeline.estimates import Array
from pipeline.evaluation.map import Asked, MapQuality, map_quality
from pipeline.evaluation.trajectory import Trajectory
from pipeline.inventory.source import open_map

STRIDE = 24
"""One point of so many: half a million of a walk of 400 m by bicycle."""
RESOLUTION_M = 0.0005


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """points_m: (n, 3) where they truly are. sweep: (n,) which each is of. seconds: (n,) when each was measured."""

    points_m: Array
    sweep: npt.NDArray[np.int64]
    seconds: Array

    def laid(self, poses: Trajectory, truth: Trajectory) -> Array:
        """(n, 3)."""
        true = truth.at(poses.stamps_ns)
        turns = poses.rotations @ true.rotations.transpose(0, 2, 1)
        moves = poses.positions_m - np.einsum("kij,kj->ki", turns, true.positions_m)
        row = np.full(int(self.sweep.max()) + 1, -1)
        sweeps, rows = np.unique(sweeps_of(poses), return_index=True)
        row[sweeps[sweeps < len(row)]] = rows[sweeps < len(row)]
        which = row[self.sweep]
        return np.asarray(np.einsum("nij,nj->ni", turns[which], self.points_m) + moves[which])


def sweeps_of(poses: Trajectory) -> npt.NDArray[np.int64]:
    """(k,) the sweep that each pose is of: stamped between a millisecond after its start and one after its end."""
    return np.asarray((poses.stamps_ns - EPOCH_NS - KNOT_NS) // SCAN_NS)


def cloud(walk: Walk, truth: Trajectory, ways: Sequence[Trajectory]) -> Cloud:
    """Of the sweeps that all ways have a pose of."""
    shared = set.intersection(*(set(sweeps_of(way).tolist()) for way in ways))
    knots_ns = np.arange(truth.stamps_ns[0], truth.stamps_ns[-1], KNOT_NS)
    true, parts = truth.at(knots_ns), []
    for k, scan in enumerate(walk.scans()):
        if k in shared:
            taken = np.flatnonzero(np.linalg.norm(scan.xyz_m, axis=1) > NEAREST_M)[::STRIDE]
            stamps = scan.stamp_ns + scan.offset_ns[taken].astype(np.int64)
            knot = np.minimum((stamps - knots_ns[0] + KNOT_NS // 2) // KNOT_NS, len(knots_ns) - 1)
            turned = np.einsum("nij,nj->ni", true.rotations[knot], scan.xyz_m[taken] + np.array(LIDAR_IN_BASE_M))
            parts.append((turned + true.positions_m[knot], np.full(len(taken), k), (stamps - EPOCH_NS) / 1e9))
    return Cloud(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def quality(points_m: Array, seconds: Array) -> MapQuality:
    """What `evaluate map` says of a file with these points."""
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.offsets, header.scales = np.floor(points_m.min(axis=0)), np.full(3, RESOLUTION_M)
    record = laspy.LasData(header)
    record.xyz, record.gps_time = points_m, seconds
    with tempfile.TemporaryDirectory(prefix="mapforest-laid-") as folder:
        path = Path(folder) / "map.las"
        record.write(path)
        return map_quality(open_map(path), Asked())
