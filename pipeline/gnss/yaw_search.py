"""Gathers sightings until the way they span says which way `odom` is turned."""

from __future__ import annotations

import math

import numpy as np

from pipeline.gnss.alignment import Alignment, align
from pipeline.gnss.bank import Bank
from pipeline.gnss.config import FusionConfig
from pipeline.gnss.sighting import Sighting

MOST = 400
"""Sightings kept; beyond, every second one is let go."""
FEWEST = 8


class YawSearch:
    """Sightings so far, at least `spacing` apart in time."""

    def __init__(self, config: FusionConfig) -> None:
        self._config = config
        self._spacing_ns = 500_000_000
        self.sightings: list[Sighting] = []

    def add(self, sighting: Sighting) -> Alignment | None:
        """The alignment, once its yaw is known well enough."""
        kept = self.sightings
        if kept and sighting.passage.stamp_ns - kept[-1].passage.stamp_ns < self._spacing_ns:
            return None
        kept.append(sighting)
        if len(kept) > MOST:
            del kept[::2]
            self._spacing_ns *= 2
        alignment = self.alignment()
        known = alignment is not None and math.degrees(alignment.yaw_sigma) < self._config.yaw_known_deg
        return alignment if known else None

    def alignment(self) -> Alignment | None:
        """From all sightings so far; None for too few."""
        if len(self.sightings) < FEWEST:
            return None
        times_s = np.array([sighting.passage.stamp_ns for sighting in self.sightings]) / 1e9
        lasting_s = 2.0 * self._config.correlation_s
        share = np.diff(times_s, prepend=times_s[0] - lasting_s) / lasting_s if lasting_s else np.ones(len(times_s))
        return align(
            np.array([sighting.passage.antenna_m for sighting in self.sightings]),
            np.array([sighting.position_m for sighting in self.sightings]),
            np.array([sighting.sigma_m for sighting in self.sightings]),
            np.clip(share, 1e-3, 1.0),
        )

    def bank(self, alignment: Alignment) -> Bank:
        """The filters, having followed all sightings so far."""
        bank = Bank(alignment, self.sightings[0].passage, self._config)
        for sighting in self.sightings:
            bank.follow(sighting)
        return bank
