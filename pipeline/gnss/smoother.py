"""After the session: the same filter, then backwards (Rauch, Tung, Striebel), so that every fix serves every pose."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass

import msgspec
import numpy as np

from drivers.messages import GnssFix
from pipeline.estimates import Array, GlobalPose, OdometryEstimate
from pipeline.gnss.alignment import Alignment
from pipeline.gnss.bank import trackers
from pipeline.gnss.belief import YAW, Belief
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.fusion import pose_from
from pipeline.gnss.geodesy import Datum
from pipeline.gnss.history import History
from pipeline.gnss.lateness import lateness
from pipeline.gnss.sighting import Sighting, Sightings
from pipeline.gnss.tracker import Step
from pipeline.gnss.yaw_search import YawSearch

PASSES = 2
"""The second begins where the first ended up, so that its gate is right from the first fix on."""


@dataclass(frozen=True, slots=True)
class Knot:
    """The antenna and the yaw at a sighting: mean (4,) x, y, z, yaw; covariance (4, 4)."""

    sighting: Sighting
    mean: Array
    covariance: Array


class SmoothedDrift:
    """Where `odom` lay in `map` all along the session. notes: what is wrong with the fixes, in words."""

    def __init__(
        self, knots: list[Knot], history: History, datum: Datum, drift: Array, notes: tuple[str, ...] = ()
    ) -> None:
        self.knots = knots
        self.datum = datum
        self.notes = notes
        self._history = history
        self._drift = drift
        self._stamps = [knot.sighting.passage.stamp_ns for knot in knots]

    def pose(self, estimate: OdometryEstimate) -> GlobalPose:
        """An estimate in `map`; between two knots both are asked, the nearer by way the more."""
        passage = self._history.at(estimate.stamp_ns)
        if passage is None:
            raise ValueError(f"odometry at {estimate.stamp_ns} ns was not part of what was smoothed")
        after = bisect_left(self._stamps, estimate.stamp_ns)
        a, b = self.knots[max(after - 1, 0)], self.knots[min(after, len(self.knots) - 1)]
        ways = [knot.sighting.passage.drift_way_m for knot in (a, b)]
        since, until = (abs(passage.drift_way_m - way) for way in ways)
        share = since / (since + until) if a is not b and since + until > 0.0 else 0.0
        # A Brownian bridge, or a walk away from the only knot.
        drifted = self._drift * (since * (1.0 - share))
        first, second = (
            pose_from(estimate, knot.mean, knot.covariance, knot.sighting.passage.antenna_m, drifted) for knot in (a, b)
        )
        blend = [(1.0 - share) * x + share * y for x, y in zip(_parts(first), _parts(second), strict=True)]
        u, _, v = np.linalg.svd(blend[1])
        return GlobalPose(estimate.stamp_ns, blend[0], u @ v, blend[2])


def smooth(
    odometry: Iterable[OdometryEstimate], fixes: Iterable[GnssFix], config: FusionConfig | None = None
) -> SmoothedDrift | None:
    """From a whole session. None when its fixes cannot tell the yaw."""
    config = config or FusionConfig()
    history = History(msgspec.structs.replace(config, history_s=float("inf")))
    for estimate in odometry:
        history.add(estimate)
    placing = Sightings(history, config)
    placed = [placing.place(fix) for fix in fixes]
    sightings = [sighting for sighting in placed if sighting is not None]
    search = YawSearch(config)
    alignment = next((found for found in map(search.add, sightings) if found is not None), None)
    if alignment is None or placing.datum is None:
        return None
    for _ in range(PASSES):
        runs = [
            (tracker, [tracker.follow(sighting) for sighting in sightings])
            for tracker in trackers(alignment, sightings[0].passage, config)
        ]
        likeliest, steps = max(runs, key=lambda run: sum(step.log_likelihood for step in run[1]))
        knots = backwards(steps)
        alignment = _restart(knots[0])
    late = lateness(sightings, config)
    doubts = [*([late] if late is not None and late.sure else []), *likeliest.disputes]
    return SmoothedDrift(knots, history, placing.datum, likeliest.drift, tuple(map(str, doubts)))


def backwards(steps: list[Step]) -> list[Knot]:
    """The smoothed belief at each step of the filter."""
    smoothed = steps[-1].after
    beliefs = [smoothed]
    for step, following in zip(reversed(steps[:-1]), reversed(steps[1:]), strict=True):
        gain = np.linalg.solve(following.predicted.covariance, following.transition @ step.after.covariance).T
        mean = step.after.mean + gain @ (smoothed.mean - following.predicted.mean)
        change = smoothed.covariance - following.predicted.covariance
        smoothed = Belief(mean, step.after.covariance + gain @ change @ gain.T)
        beliefs.append(smoothed)
    return [
        Knot(step.sighting, belief.mean[:4], belief.covariance[:4, :4])
        for step, belief in zip(steps, reversed(beliefs), strict=True)
    ]


def _restart(knot: Knot) -> Alignment:
    variances = np.diag(knot.covariance)
    odom_m = knot.sighting.passage.antenna_m
    return Alignment(float(knot.mean[YAW]), float(variances[YAW]) ** 0.5, odom_m, knot.mean[:3], variances[:3])


def _parts(pose: GlobalPose) -> tuple[Array, Array, Array]:
    return pose.position_enu_m, pose.rotation, pose.covariance
