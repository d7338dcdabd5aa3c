"""Follows one sighting after another: move with the odometry, gate, correct, learn, recover."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimates import Array
from pipeline.gnss import belief as small
from pipeline.gnss.alignment import Alignment
from pipeline.gnss.belief import GATE_RATIO, YAW, Belief, Innovation
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.history import Passage
from pipeline.gnss.sighting import Sighting
from pipeline.gnss.trust import Trust

DOUBT_SIGMAS = 3.0
"""After recovery the innovation that the filter would not believe stands at so many sigmas."""
DOUBT_YAW = math.radians(10.0)
"""Added to the yaw then: a sudden turn of the odometry by 20 degrees took 150 s to get over without, 50 s with it."""
FEWEST_REJECTED = 10


@dataclass(frozen=True, slots=True)
class Dispute:
    """Odometry and fixes disagreed by `apart_m` for so long that the fixes were believed from `stamp_ns` on."""

    stamp_ns: int
    apart_m: float

    def __str__(self) -> str:
        return (
            f"GNSS moved {self.apart_m:.0f} m away from where the way had led, stayed there and is believed since: "
            "its positions before or after are off by that"
        )


@dataclass(frozen=True, slots=True)
class Step:
    """One sighting followed. transition (13, 13) leads from the belief before to `predicted`."""

    sighting: Sighting
    transition: Array
    predicted: Belief
    after: Belief
    used: bool
    log_likelihood: float


class Tracker:
    """The belief at the time of the last sighting."""

    def __init__(
        self, alignment: Alignment, first: Passage, widened: float, trust: Trust, config: FusionConfig
    ) -> None:
        covariance = widened**2 * alignment.covariance_at(first.antenna_m)
        self.belief = small.started(alignment.to_map(first.antenna_m), alignment.yaw, covariance, trust.lasting_m)
        self.passage = first
        self.drift = _drift(config)
        """(4,) variance of x, y, z, yaw a metre."""
        self.disputes: list[Dispute] = []
        self._trust = trust
        self._config = config
        self._rejected_ns: list[int] = []

    def follow(self, sighting: Sighting) -> Step:
        """Sightings come in order; one from before the last is taken as of its place."""
        config, passage = self._config, sighting.passage
        drifted = self.drift * abs(passage.drift_way_m - self.passage.drift_way_m)
        passed_s = max(passage.stamp_ns - self.passage.stamp_ns, 0) / 1e9
        keep = math.exp(-passed_s / config.correlation_s) if config.correlation_s else 0.0
        step_m = passage.antenna_m - self.passage.antenna_m
        seen = self._trust.observation(sighting.position_m, sighting.sigma_m, sighting.quality)
        predicted, transition = small.moved(self.belief, step_m, drifted, keep, self._trust.lasting_m)
        new = small.innovation(predicted, seen, config)
        self._trust.learn(seen.kind, passage.stamp_ns, new.chi2[0])
        log_likelihood = small.log_likelihood(new, config)
        used = self._gated(new, passage.stamp_ns)
        if used and not self._plausible(new):
            self.disputes.append(Dispute(passage.stamp_ns, math.sqrt(float(new.value @ new.value))))
            predicted = _doubting(predicted, new)
            new = small.innovation(predicted, seen, config)
        after = small.corrected(predicted, new, small.huber_weights(new.chi2, config)) if used else predicted
        self.belief, self.passage = after, passage
        return Step(sighting, transition, predicted, after, used, log_likelihood)

    def _plausible(self, new: Innovation) -> bool:
        return all(value <= ratio * self._config.gate for value, ratio in zip(new.chi2, GATE_RATIO, strict=True))

    def _gated(self, new: Innovation, stamp_ns: int) -> bool:
        """Whether to use a fix: it is plausible, or too many in a row were not."""
        rejected = self._rejected_ns
        if self._plausible(new):
            rejected.clear()
            return True
        rejected.append(stamp_ns)
        if len(rejected) <= FEWEST_REJECTED or stamp_ns - rejected[0] < 1e9 * self._config.recover_s:
            return False
        rejected.clear()
        return True


def _doubting(belief: Belief, new: Innovation) -> Belief:
    """So unsure of its place and its yaw that the innovation is believable."""
    covariance = belief.covariance.copy()
    covariance[range(3), range(3)] += (new.value / DOUBT_SIGMAS) ** 2
    covariance[YAW, YAW] += DOUBT_YAW**2
    return Belief(belief.mean, covariance)


def _drift(config: FusionConfig) -> Array:
    yaw = math.radians(config.drift_yaw_deg)
    return np.array([config.drift_m, config.drift_m, config.drift_up_m, yaw]) ** 2
