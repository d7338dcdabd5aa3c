"""From keyframes to every sweep: what a keyframe was corrected by fades into what the next one was."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from pipeline.estimates import Array
from pipeline.products.track import Placement
from pipeline.refinement.solver import Solution


def placement(track: npt.NDArray[np.void], solved: Solution) -> Placement:
    """`odom` at each estimate (n,) of the track in `map`, or in `local` where fixes do not tell. solved: of that
    session alone.

    The tilt that the graph found is in it: 0.3 degrees are 15 cm at 30 m.
    """
    frames, poses = solved.frames, solved.poses
    before, share = _between(track, solved)
    turns = poses.rotations @ frames.rotations.transpose(0, 2, 1)
    turned = _faded(turns, before, share)
    one, odom_m = share[:, None], track["position_m"]
    placed = (1.0 - one) * _carried(odom_m, before, turns, solved) + one * _carried(odom_m, before + 1, turns, solved)
    many = share[:, None, None]
    covariance = (1.0 - many) * solved.covariance[before] + many * solved.covariance[before + 1]
    datum = solved.datum
    return Placement(
        None if datum is None else (datum.latitude_deg, datum.longitude_deg, datum.height_m),
        placed - np.einsum("nij,nj->ni", turned, odom_m),
        turned,
        covariance,
    )


def _faded(turns: Array, before: npt.NDArray[np.int64], share: Array) -> Array:
    """(n, 3, 3) along the shortest way from the correction (m, 3, 3) of one keyframe to that of the next."""
    steps = Rotation.from_matrix(turns[:-1].transpose(0, 2, 1) @ turns[1:]).as_rotvec()
    return np.asarray(turns[before] @ Rotation.from_rotvec(share[:, None] * steps[before]).as_matrix())


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
