"""One fault on one walk: what the odometry estimated, what it said, and how far off it was."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.odometry.faults.catalogue import Case
from benchmarks.odometry.faults.streams import SECOND_NS, Span, Streams
from drivers.messages import LidarScan
from pipeline.evaluation.trajectory import Trajectory
from pipeline.odometry.config import OdometryConfig
from pipeline.odometry.estimate import Odometry, Status
from pipeline.odometry.odometry import LidarInertialOdometry

LAST_S = 2.0
"""What counts as the end of the walk."""
BEFORE_S = 0.5
"""Of the poses that are laid over the truth where a fault is there from the start."""
OUTSIDE_SIGMAS = 4.0
SWEEP_NS = 100_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """estimates: in order. refusals: delivery of a scan that brought none after the first, and what was said of it."""

    estimates: list[Odometry]
    refusals: list[tuple[int, str]]


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """worst_m: greatest error while the fault lasts and a second longer. end_m, end_sigma_m: mean error, and the stated
    sigma, at the end of the walk. outside: share of the poses from the fault on whose error is beyond `OUTSIDE_SIGMAS`.

    silent_s: longest time without an estimate. statuses, notes: what was said from the fault on, and of how many scans;
    TRACKING apart.
    """

    worst_m: float
    end_m: float
    end_sigma_m: float
    outside: float
    silent_s: float
    statuses: Counter[Status]
    notes: Counter[str]


def tried(case: Case, streams: Streams) -> Outcome:
    """A fault done to a walk."""
    begin_ns = int(streams.truth.stamps_ns[0] + case.begin_s * SECOND_NS)
    span = Span(begin_ns, begin_ns + int(case.lasts_s * SECOND_NS))
    told = run(case.fault(streams, span), case.config)
    return judge(told, streams.truth, span, int(case.leaps_s * SECOND_NS))


def run(streams: Streams, config: OdometryConfig) -> Told:
    """As the messages are delivered."""
    odometry, found, refusals = LidarInertialOdometry(config), [], []
    for message in streams.delivered():
        if not isinstance(message, LidarScan):
            odometry.offer_imu(message)
            continue
        odometry.offer_scan(message)
        came = list(odometry.take())
        found += came
        if found and not came and odometry.refusal:
            refusals.append((message.receive_ns, odometry.refusal))
    return Told([*found, *odometry.take(flush=True)], refusals)


def judge(told: Told, truth: Trajectory, span: Span, leaps_ns: int = 0) -> Outcome:
    """Against the truth, the estimates before the fault laid over it by heading and place.

    leaps_ns: by how much stamps from the fault on are wrong. ValueError when there is nothing to judge.
    """
    found, stamps = told.estimates, np.array([one.stamp_ns for one in told.estimates])
    if leaps_ns and len(found):
        leapt = np.arange(len(stamps)) >= np.searchsorted(stamps, span.begin_ns + SWEEP_NS)
        stamps = np.where(leapt, stamps - leaps_ns, stamps)
    inside = (stamps >= truth.stamps_ns[0]) & (stamps <= truth.stamps_ns[-1])
    found, stamps = [one for one, within in zip(found, inside, strict=True) if within], stamps[inside]
    if not found:
        raise ValueError("no estimates within the time of the truth")
    true = truth.at(stamps)
    until = max(span.begin_ns, int(stamps[0] + BEFORE_S * SECOND_NS))
    error = _laid(found, true, stamps < until) - true.positions_m
    size = np.linalg.norm(error, axis=1)
    covariance = np.array([one.covariance[3:6, 3:6] for one in found])
    sigmas = np.sqrt(np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0]))
    since, end = stamps >= span.begin_ns - SWEEP_NS, stamps > truth.stamps_ns[-1] - LAST_S * SECOND_NS
    after = [one for one, later in zip(found, since, strict=True) if later]
    return Outcome(
        worst_m=float(size[since & (stamps < span.end_ns + SECOND_NS)].max(initial=0.0)),
        end_m=float(size[end].mean()) if end.any() else float("nan"),
        end_sigma_m=float(np.sqrt(np.trace(covariance[-1]))),
        outside=float((sigmas[since] > OUTSIDE_SIGMAS).mean()),
        silent_s=float(np.diff([*stamps, truth.stamps_ns[-1]]).max()) / SECOND_NS,
        statuses=Counter(one.status for one in after if one.status is not Status.TRACKING),
        notes=Counter([*_words(after), *(text for at, text in told.refusals if at >= until)]),
    )


def _words(found: list[Odometry]) -> Iterator[str]:
    return (words for one in found for words in one.note.split("; ") if words)


def _laid(found: list[Odometry], true: Trajectory, before: np.ndarray) -> np.ndarray:
    """Positions (n, 3) turned by the mean heading and moved by the mean place of the poses before."""
    turns = true.rotations[before] @ np.array([one.rotation.T for one in found])[before]
    across = turns.sum(axis=0)
    yaw = np.arctan2(across[1, 0] - across[0, 1], across[0, 0] + across[1, 1])
    c, s = np.cos(yaw), np.sin(yaw)
    positions = np.array([one.position_m for one in found]) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return positions + (true.positions_m[before] - positions[before]).mean(axis=0)
