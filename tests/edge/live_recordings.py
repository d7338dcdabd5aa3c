"""Sessions with what a live pipeline says of a walk, through the encoders and the recorder."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from edge.live.poses import gnss_pose, odometry_pose, transforms
from edge.recording.account import SessionAbout
from edge.recording.anchor import Anchor
from edge.recording.session import SessionRecorder, session_folder
from pipeline.estimates import GlobalPose, MapToOdom, OdometryEstimate
from pipeline.gnss.geodesy import Datum
from tests.edge.recording.recording_scene import UTC_NS, FakeClock, FaultyDisk, limits


def record(root: Path, messages: Iterable) -> Path:
    """The session's folder. Session time is host time plus UTC_NS."""
    anchor = Anchor(UTC_NS, 0)
    folder = session_folder(root, "walk", anchor)
    recorder = SessionRecorder(
        folder, SessionAbout(software="0.1"), limits(), anchor, clock=FakeClock(), disk=FaultyDisk()
    )
    recorder.start()
    for message in messages:
        recorder.offer(message)
    return recorder.stop("operator").folder


def told(
    stamp_ns: int, rotation: np.ndarray, covariance: np.ndarray, *, odom_m: np.ndarray, map_m: np.ndarray, datum: Datum
) -> list:
    """Of one sweep, as the live pipeline sends it. covariance: (6, 6), of both poses."""
    nothing, zero = np.empty((0, 3)), np.zeros(3)
    estimate = OdometryEstimate(
        stamp_ns, odom_m, rotation, zero, covariance, zero, zero, travelled_m=0.0, degenerate=False,
        weak_directions=nothing, points=1, matches=1,
    )  # fmt: skip
    place = (datum.latitude_deg, datum.longitude_deg, datum.height_m)
    state = MapToOdom(stamp_ns, zero, 0.0, np.eye(4), place, fixes_used=1, fixes_rejected=0, observable=True)
    now_ns = stamp_ns + 20_000_000
    return [
        odometry_pose(estimate, now_ns),
        transforms(estimate, state, now_ns),
        gnss_pose(GlobalPose(stamp_ns, map_m, rotation, covariance), now_ns),
    ]
