"""Follows one sighting after another: move with the odometry, gate, correct, learn, recover."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.messages import FixQuality
from pipeline.estimates import Array
from pipeline.gnss import belief as small
from pipeline.gnss.alignment import Alignment
from pipeline.gnss.belief import AXES, GATE_RATIO, Belief, Observation
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.history import Passage
from pipeline.gnss.trust import Trust

MOST_DOUBT = 3.0
"""After recovery the innovation that the filter would not believe stands at so many sigmas."""
FEWEST_REJECTED = 10


@dataclass(frozen=True, slots=True)
class Sighting:
    """A fix in `map` (3,) with its sigmas (3,) before any scale, and where the odometry saw the antenna then."""

    passage: Passage
    position_m: Array
    sigma_m: Array
    quality: FixQuality


@dataclass(frozen=True, slots=True)
class Step:
    """One sighting followed. transition (7, 7) leads from the belief before to `predicted`."""

    sighting: Sighting
    transition: Array
    predicted: Belief
    seen: Observation
    allowed: Array
    after: Belief

    @property
    def used(self) -> bool:
        """Whether the horizontal part was taken."""
        return bool(self.allowed[0])


class Tracker:
    """The belief at the time of the last sighting."""

    def __init__(self, alignment: Alignment, first: Passage, widened: float, trust: Trust, config: FusionConfig) -> None:
        covariance = widened**2 * alignment.covariance_at(first.antenna_m)
        self.belief = small.started(alignment.to_map(first.antenna_m), alignment.yaw, covariance, trust.lasting_m)
        self.passage = first
        self._trust = trust
        self._config = config
        self._rejected: list[list[int]] = [[], []]

    def follow(self, sighting: Sighting) -> Step:
        """Sightings come in order; one from before the last is taken as of its place."""
        config, passage = self._config, sighting.passage
        way_m = abs(passage.drift_way_m - self.passage.drift_way_m)
        passed_s = max(passage.stamp_ns - self.passage.stamp_ns, 0) / 1e9
        step_m = passage.antenna_m - self.passage.antenna_m
        seen = self._trust.observation(sighting.position_m, sighting.sigma_m, sighting.quality)
        predicted, transition = small.moved(self.belief, step_m, way_m, passed_s, self._trust.lasting_m, config)
        chi2 = small.innovation_chi2(predicted, seen, config)
        self._trust.learn(seen.kind, passage.stamp_ns, chi2[0])
        predicted, allowed = self._gated(predicted, seen, chi2, passage.stamp_ns)
        self.belief = small.robustly_corrected(predicted, seen, allowed, config)
        self.passage = passage
        return Step(sighting, transition, predicted, seen, allowed, self.belief)

    def _gated(
        self, predicted: Belief, seen: Observation, chi2: tuple[float, float], stamp_ns: int
    ) -> tuple[Belief, Array]:
        """What may be used of the fix (3,) and the belief, in doubt of itself where it refused for too long."""
        allowed = np.ones(3)
        for axes, ratio, value, rejected in zip(AXES, GATE_RATIO, chi2, self._rejected, strict=True):
            if value <= ratio * self._config.gate:
                rejected.clear()
                continue
            rejected.append(stamp_ns)
            if len(rejected) > FEWEST_REJECTED and stamp_ns - rejected[0] > 1e9 * self._config.recover_s:
                rejected.clear()
                predicted = _doubting(predicted, seen, axes)
            else:
                allowed[:] = 0.0
        return predicted, allowed


def _doubting(belief: Belief, seen: Observation, axes: slice) -> Belief:
    covariance = belief.covariance.copy()
    places = range(axes.start, axes.stop)
    covariance[places, places] += float(((seen.position_m - belief.mean[:3])[axes] ** 2).sum()) / MOST_DOUBT**2
    return Belief(belief.mean, covariance)
