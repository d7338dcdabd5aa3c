"""Submaps of a cast walk as `process` keeps them: made once for an odometry's poses, and kept beside the walk.

The odometry's poses are those of its run over the walk (`ours_1.npz`); between two of them the carrier moves along a
spline, so that a sweep is deskewed without running the odometry again.
"""

from __future__ import annotations

import zlib

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from benchmarks.odometry.simulated import EPOCH_NS, LIDAR_IN_BASE_M, Walk
from drivers.messages import LidarScan
from pipeline.estimates import OdometryEstimate
from pipeline.refinement.submaps import STRIDE_M, Submap, SubmapWriter, read_submaps

NEAREST_M = 0.5
KNOT_NS = 1_000_000


def submaps_of(walk: Walk, estimates: list[OdometryEstimate]) -> list[Submap]:
    """Numbered as the estimates, whose stamps are walk time."""
    poses = zlib.crc32(np.array([one.position_m for one in estimates]).tobytes())
    folder = walk.folder / f"submaps_{poses:08x}"
    if not folder.exists():
        draft = folder.with_suffix(".draft")
        _write(walk, estimates, SubmapWriter(draft))
        draft.rename(folder)
    return read_submaps(folder)


def _write(walk: Walk, estimates: list[OdometryEstimate], submaps: SubmapWriter) -> None:
    way = _Way(estimates)
    ends = np.array([one.stamp_ns for one in estimates]) + EPOCH_NS
    last_m = -np.inf
    for scan in walk.scans():
        sweep = int(np.searchsorted(ends, scan.stamp_ns + KNOT_NS))
        if sweep < len(estimates) and sweep and estimates[sweep].travelled_m - last_m >= STRIDE_M:
            last_m = estimates[sweep].travelled_m
            submaps.add(estimates[sweep], way.points(scan), sweep)
    submaps.close()


class _Way:
    """Where `base_link` was in `odom`, at any time between the first estimate and the last."""

    def __init__(self, estimates: list[OdometryEstimate]) -> None:
        seconds = np.array([one.stamp_ns for one in estimates]) / 1e9
        self._places = CubicSpline(seconds, np.array([one.position_m for one in estimates]))
        self._turns = RotationSpline(seconds, Rotation.from_matrix(np.array([one.rotation for one in estimates])))
        self._span_s = (seconds[0], seconds[-1])

    def points(self, scan: LidarScan) -> npt.NDArray[np.float32]:
        """(n, 3) in `odom`; each point from where it was seen, to a millisecond."""
        seen = np.linalg.norm(scan.xyz_m, axis=1) > NEAREST_M
        xyz = scan.xyz_m[seen].astype(np.float64) + LIDAR_IN_BASE_M
        knots, which = np.unique(scan.offset_ns[seen] // KNOT_NS, return_inverse=True)
        seconds = (scan.stamp_ns - EPOCH_NS + (knots.astype(np.int64) * KNOT_NS + KNOT_NS // 2)) / 1e9
        seconds = np.clip(seconds, *self._span_s)
        turned = np.einsum("nij,nj->ni", self._turns(seconds).as_matrix()[which], xyz)
        return (turned + self._places(seconds)[which]).astype(np.float32)
