"""Trackers side by side that differ in how much drift they expect, weighted by how well each foretold the fixes.

The odometry drifts by what the forest gives it to hold on to: by 0.1 % of the way among stems, ten times that in a
meadow. With the wrong figure the fixes are followed too closely or too late.
"""

from __future__ import annotations

import numpy as np

from pipeline.estimates import Array
from pipeline.gnss.alignment import Alignment
from pipeline.gnss.belief import Belief
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.history import Passage
from pipeline.gnss.sighting import Sighting
from pipeline.gnss.tracker import Dispute, Tracker
from pipeline.gnss.trust import Trust

MEMORY = 0.995
"""Of the evidence, from one used fix to the next: some minutes, so that what the forest was before is forgotten."""
INDEPENDENT = 0.3
"""Share of an innovation's likelihood that counts: the receiver's errors last otherwise than assumed."""
WIDENED = 3.0
"""An alignment's sigmas are taken that many times larger as a prior, since the same fixes are seen again."""


class Bank:
    """belief: mean and covariance of the mixture, at `passage`, where the last sighting was.

    drift: (4,) variance of x, y, z, yaw a metre that the mixture expects.
    """

    def __init__(self, alignment: Alignment, first: Passage, config: FusionConfig) -> None:
        self._trackers = trackers(alignment, first, config)
        self._evidence = np.zeros(len(self._trackers))
        self._mix()

    @property
    def disputes(self) -> list[Dispute]:
        """Of the likeliest tracker."""
        return self._trackers[int(np.argmax(self._evidence))].disputes

    def follow(self, sighting: Sighting) -> bool:
        """Whether the likeliest tracker used it."""
        steps = [tracker.follow(sighting) for tracker in self._trackers]
        used = steps[int(np.argmax(self._evidence))].used
        self._evidence = MEMORY * self._evidence + [INDEPENDENT * step.log_likelihood for step in steps]
        self._mix()
        return used

    def _mix(self) -> None:
        likelihood = np.exp(self._evidence - self._evidence.max())
        weights = likelihood / likelihood.sum()
        means = np.array([tracker.belief.mean for tracker in self._trackers])
        mean = weights @ means
        covariance = np.tensordot(weights, [tracker.belief.covariance for tracker in self._trackers], 1)
        self.belief = Belief(mean, covariance + (weights[:, None] * (means - mean)).T @ (means - mean))
        self.drift: Array = weights @ np.array([tracker.drift for tracker in self._trackers])
        self.passage = self._trackers[0].passage


def trackers(alignment: Alignment, first: Passage, config: FusionConfig) -> list[Tracker]:
    """One for each of `drift_scales`, all beginning at a passage that was aligned."""
    return [
        Tracker(alignment, first, WIDENED, Trust(scaled), scaled) for scaled in map(config.scaled, config.drift_scales)
    ]
