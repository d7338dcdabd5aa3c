"""From keyframes to every sweep: what a keyframe was corrected by fades into what the next one was."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.estimates import Array
from pipeline.products.track import Placement
from pipeline.refinement.solver import Solution


def placement(track: npt.NDArray[np.void], solved: Solution) -> Placement | None:
    """`odom` in `map` at each estimate (n,) of the track; None where fixes do not tell. solved: of that session alone.

    By yaw and translation: gravity levels `odom`, so that no more is left of roll and pitch than `chain.level_deg`.
    """
    if solved.datum is None:
        return None
    translation, yaw, covariance = corrections(track, solved)
    datum = (solved.datum.latitude_deg, solved.datum.longitude_deg, solved.datum.height_m)
    return Placement(datum, translation, yaw, covariance)


def corrections(track: npt.NDArray[np.void], solved: Solution) -> tuple[Array, Array, Array]:
    """Translation (n, 3), yaw (n,), and covariance (n, 6, 6) of `base_link`, at each estimate."""
    frames, poses = solved.frames, solved.poses
    before, share = _between(track, solved)
    turns = poses.rotations @ frames.rotations.transpose(0, 2, 1)
    yaw = np.unwrap(np.arctan2(turns[:, 1, 0] - turns[:, 0, 1], turns[:, 0, 0] + turns[:, 1, 1]))
    yaw_rad = (1.0 - share) * yaw[before] + share * yaw[before + 1]
    one = share[:, None]
    odom_m = track["position_m"]
    placed = (1.0 - one) * _carried(odom_m, before, turns, solved) + one * _carried(odom_m, before + 1, turns, solved)
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    x, y, z = odom_m.T
    translation = placed - np.column_stack([cosine * x - sine * y, sine * x + cosine * y, z])
    many = share[:, None, None]
    covariance = (1.0 - many) * solved.covariance[before] + many * solved.covariance[before + 1]
    return translation, yaw_rad, covariance


def corrected(track: npt.NDArray[np.void], solved: Solution) -> tuple[Array, Array]:
    """Positions (n, 3) and rotations (n, 3, 3) of the whole track, in the frame of the solution."""
    return Placement((0.0, 0.0, 0.0), *corrections(track, solved)).poses(track)


def _between(track: npt.NDArray[np.void], solved: Solution) -> tuple[npt.NDArray[np.int64], Array]:
    """(n,) the keyframe before each estimate, and how much of the way to the next one is behind it: 0..1, by distance
    travelled, or by time where the carrier stood."""
    frames = solved.frames
    before = np.clip(np.searchsorted(frames.index, np.arange(len(track)), side="right") - 1, 0, len(frames) - 2)
    way, time = track["travelled_m"], track["stamp_ns"].astype(np.float64)
    first, last = frames.index[before], frames.index[before + 1]
    moved = way[last] - way[first]
    by_way = (way - way[first]) / np.maximum(moved, 1e-9)
    by_time = (time - time[first]) / np.maximum(time[last] - time[first], 1.0)
    return before, np.clip(np.where(moved > 0.1, by_way, by_time), 0.0, 1.0)


def _carried(odom_m: Array, which: npt.NDArray[np.int64], turns: Array, solved: Solution) -> Array:
    arm = odom_m - solved.frames.positions_m[which]
    return np.asarray(solved.poses.positions_m[which] + np.einsum("nij,nj->ni", turns[which], arm))
