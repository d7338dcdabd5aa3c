"""Where a live pipeline said the payload was, read back from the recording it went into."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from edge.config import Config
from edge.replay.store import MessageStore
from edge.ros import schemas
from edge.ros.decode import decode_transforms
from edge.ros.decode_poses import Pose, decode_odometry, decode_pose
from edge.ros.frames import EARTH, MAP, Transform
from pipeline.evaluation.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class LivePoses:
    """`base_link` in session time; None where the recording has none.

    odom: in `odom`. earth: in Earth-centred axes, each pose by the datum that held when it was recorded.
    """

    odom: Trajectory | None = None
    earth: Trajectory | None = None


def read_live_poses(folder: Path, config: Config) -> LivePoses:
    """From a session's folder, by the topics it was recorded with. FormatError for what is no recording."""
    store = MessageStore([folder])
    topics = store.recording.effective(config).topics
    wanted = {topics.odometry: schemas.ODOMETRY, topics.gnss_pose: schemas.POSE, topics.tf: schemas.TF_MESSAGE}
    there = {name for name, kind in wanted.items() if name in store.topics and store.topics[name].type_name == kind}
    odom: list[Pose] = []
    placed: list[Pose] = []
    datums: list[tuple[int, Transform]] = []
    for raw in store.messages(there):
        if raw.topic == topics.odometry:
            odom.append(decode_odometry(raw.data).pose)
        elif raw.topic == topics.gnss_pose:
            placed.append(decode_pose(raw.data))
        else:
            datums += [one for one in decode_transforms(raw.data) if (one[1].parent, one[1].child) == (EARTH, MAP)]
    return LivePoses(_trajectory(odom), _on_earth(_trajectory(placed), datums))


def _trajectory(poses: Sequence[Pose]) -> Trajectory | None:
    if not poses:
        return None
    stamps = np.array([pose.stamp_ns for pose in poses], np.int64)
    covariance = np.array([pose.covariance for pose in poses]).reshape(-1, 6, 6)
    rotations = Rotation.from_quat(np.array([pose.rotation_xyzw for pose in poses])).as_matrix()
    # Of the covariance the part of the position alone, which is the same whichever axes rotations are about.
    found = Trajectory(stamps, np.array([pose.position_m for pose in poses]), rotations, covariance[:, :3, :3])
    return found.chosen(_rising(stamps))


def _on_earth(placed: Trajectory | None, datums: Sequence[tuple[int, Transform]]) -> Trajectory | None:
    """A pipeline that was started again has another datum: each pose by the last one told."""
    if placed is None or placed.covariance is None or not datums:
        return None
    stamps = np.array([stamp_ns for stamp_ns, _ in datums], np.int64)
    told = np.maximum(np.searchsorted(stamps, placed.stamps_ns, side="right") - 1, 0)
    turns = Rotation.from_quat(np.array([one.rotation_xyzw for _, one in datums])).as_matrix()[told]
    origins = np.array([one.translation_m for _, one in datums])[told]
    covariance = turns @ placed.covariance @ turns.transpose(0, 2, 1)
    positions = np.einsum("nij,nj->ni", turns, placed.positions_m) + origins
    return Trajectory(placed.stamps_ns, positions, turns @ placed.rotations, covariance)


def _rising(stamps: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    return np.diff(np.maximum.accumulate(stamps), prepend=stamps[0] - 1) > 0
