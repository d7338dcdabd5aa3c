"""What each view said of each hypothesis, kept for the look over all views at the end."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pipeline.grounding.columns import Columns
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.joint import Claims
from pipeline.grounding.likelihood import miss, recall, sureness
from pipeline.grounding.sighting import Sighting

Array = npt.NDArray[np.float64]
HIDDEN_SHARE, HIDDEN_M = 0.12, 4.0
"""Of the boxes whose range is that of something before the tree; and how far before, as an exponential."""
WIDEST = 12.0
"""Chi-square across, beyond which a box means something else."""
FOREMOST = 3.5
"""Sigmas that a tree may stand before the range seen."""
EXACT, ROUGH = 0.02, 0.05
"""Of a box's lower edge, as shares of its height: so far off means nothing, and from there on a sigma."""
MOST_AMISS = 4.0
"""Half a chi-square at most: a detector may cut a tree short."""


class Looks:
    """Grows by some hundred bytes a view with boxes. Hypotheses are known by their number, from 0."""

    def __init__(self, config: GroundingConfig) -> None:
        self.claims: list[Claims] = []
        self._config = config
        self._unclaimed: dict[int, float] = defaultdict(float)
        self._from_m: dict[int, Array] = {}

    def unclaimed(self, count: int) -> Array:
        """(n,) log-odds that views without a box that may mean them add to the first hypotheses."""
        return np.array([self._unclaimed.get(number, 0.0) for number in range(count)])

    def add(
        self,
        numbers: npt.NDArray[np.int64],
        means_m: Array,
        spreads_m2: Array,
        *,
        columns: Columns,
        sightings: Sequence[Sighting],
        from_m: Array,
    ) -> None:
        """One view from a place (2,), of the hypotheses around: numbers (h,), means (h, 2), spreads (h, 2, 2)."""
        config = self._config
        fits = [self._fit(one, means_m, spreads_m2, columns, from_m) for one in sightings]
        fit: Array = np.array(fits).reshape(len(sightings), len(numbers)).T
        claimed = np.asarray((fit > 0.0).any(axis=1), np.bool_)
        range_m = np.linalg.norm(means_m - from_m, axis=1).astype(np.float32)
        missed = np.where(columns.shown, miss(range_m, config.farthest_m, config.evidence), 0.0)
        missed = missed * np.where(columns.under(sightings), config.covered, 1.0)
        fresh = np.zeros(len(numbers))
        for k in np.flatnonzero(claimed | columns.shown):
            fresh[k] = self._freshness(int(numbers[k]), from_m)
            if not claimed[k]:
                self._unclaimed[int(numbers[k])] += fresh[k] * missed[k]
        if not claimed.any():
            return
        found = recall(range_m, config.farthest_m, config.evidence).astype(np.float64)
        sure = np.array([sureness(one.confidence) for one in sightings])
        gain = np.outer(found / config.evidence.false_share, sure)
        parts = (fresh, fit, gain, missed)
        self.claims.append(Claims(numbers[claimed], *(part[claimed] for part in parts)))

    def _fit(self, one: Sighting, means_m: Array, spreads_m2: Array, columns: Columns, from_m: Array) -> Array:
        """(h,) density (1/m2) of a box, as that of each: by bearing, range and lower edge."""
        aside = np.array([-one.ahead[1], one.ahead[0]])
        away = means_m - from_m
        along, across = away @ one.ahead, away @ aside
        short = along - one.range_m - self._config.near_side_m
        spread_along, spread_across = (np.einsum("i,hij,j->h", axis, spreads_m2, axis) for axis in (one.ahead, aside))
        variance_along = spread_along + one.sigma_m[0] ** 2
        variance_across = spread_across + (one.sigma_m[1] * np.maximum(along, 0.1) / one.range_m) ** 2
        hidden = np.where(short > 0.0, np.exp(-np.maximum(short, 0.0) / HIDDEN_M) / HIDDEN_M, 0.0)
        density = (1.0 - HIDDEN_SHARE) * _normal(short, variance_along) + HIDDEN_SHARE * hidden
        height_px = one.box_px[3] - one.box_px[1]
        amiss = np.maximum(columns.amiss_px(one.box_px[3]) / height_px - EXACT, 0.0) / ROUGH
        density = density * _normal(across, variance_across) * np.exp(-np.minimum(0.5 * amiss**2, MOST_AMISS))
        none = (across**2 > WIDEST * variance_across) | (short < -FOREMOST * np.sqrt(variance_along)) | (along < 0.5)
        return np.asarray(np.where(none, 0.0, density))

    def _freshness(self, number: int, from_m: Array) -> float:
        """How much of a new view a look from a place is; remembers the place."""
        last = self._from_m.get(number)
        self._from_m[number] = from_m
        if last is None:
            return 1.0
        evidence = self._config.evidence
        return min(max(float(np.linalg.norm(from_m - last)) / evidence.fresh_m, evidence.least_fresh), 1.0)


def _normal(away: Array, variance: Array) -> Array:
    return np.asarray(np.exp(-0.5 * away**2 / variance) / np.sqrt(2.0 * math.pi * variance))
