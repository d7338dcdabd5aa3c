"""Trees that may be targets: the stems of the map, and what boxes point at where no stem was found.

Each view speaks for the one that a box means, and against those that it shows unhidden without one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from pipeline.grounding.columns import Columns
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.depth import DepthImage
from pipeline.grounding.joint import settled
from pipeline.grounding.likelihood import hit, log_odds, miss
from pipeline.grounding.looks import Looks
from pipeline.grounding.sighting import Sighting
from pipeline.grounding.stems import SIGMA_M, Stem
from pipeline.grounding.views import CameraView
from pipeline.trees import View

Array = npt.NDArray[np.float64]
NEVER = 1e6
BLOCK_M = 16.0
NEAR_SIDE_M = 0.35
"""Without a stem the place is that of what was seen, mostly from one side."""


@dataclass(slots=True, eq=False)
class Hypothesis:
    """mean_m (2,), covariance (2, 2): horizontal. layers: of the stem; 0 for one that boxes alone point at.

    from_m: (2,) where it was last looked at from, None at first. number: in the order of their beginning. height_m: of
    the camera then. ranges_m: their sum over the hits, for the mean.
    """

    mean_m: Array
    covariance: Array
    height_m: float
    log_odds: float
    layers: float = 0.0
    number: int = 0
    first_ns: int = 0
    last_ns: int = 0
    views: int = 0
    hits: int = 0
    ranges_m: float = 0.0
    from_m: Array | None = None
    lasting_rad: float = 0.0
    lasting_m: float = 0.0
    best: list[View] = field(default_factory=list)

    def freshness(self, place_m: Array, config: GroundingConfig) -> float:
        """How much of a new view a look from a place (2,) is; remembers the place."""
        last, self.from_m = self.from_m, place_m
        if last is None:
            return 1.0
        share = float(np.linalg.norm(place_m - last)) / config.evidence.fresh_m
        return min(max(share, config.evidence.least_fresh), 1.0)

    def add(self, change: float, config: GroundingConfig) -> None:
        """Evidence in log-odds."""
        most = config.evidence.most_log_odds
        self.log_odds = min(max(self.log_odds + change, -most), most)

    def correct(self, sighting: Sighting, fresh: float) -> None:
        """Kalman update of a place without a stem; a look that is not fresh repeats the errors of the one before."""
        noise = sighting.covariance / fresh
        gain = self.covariance @ np.linalg.inv(self.covariance + noise)
        self.mean_m = self.mean_m + gain @ (sighting.place_m - self.mean_m)
        keep = np.eye(2) - gain
        self.covariance = keep @ self.covariance @ keep.T + gain @ noise @ gain.T

    def show(self, view: View, kept: int) -> None:
        """Keep the views that show it best: large and sure, and not two of the same second."""
        near = next((one for one in self.best if abs(one.stamp_ns - view.stamp_ns) < 1_500_000_000), None)
        if near is not None and near.confidence / near.range_m >= view.confidence / view.range_m:
            return
        self.best = sorted(
            [*(one for one in self.best if one is not near), view], key=lambda v: v.range_m / v.confidence
        )
        del self.best[kept:]


class Hypotheses:
    """All of them. Deterministic in the order of the calls; not thread-safe."""

    def __init__(self, config: GroundingConfig) -> None:
        self._config = config
        self._blocks: dict[tuple[int, int], list[Hypothesis]] = defaultdict(list)
        self._looks = Looks(config)
        self._count = 0
        self._prior, self._prior_free = log_odds(config.evidence.prior), log_odds(config.evidence.prior_free)

    def __iter__(self) -> Iterator[Hypothesis]:
        return (one for block in self._blocks.values() for one in block)

    def anchor(self, stems: Sequence[Stem], height_m: float) -> None:
        """Stems of the map, found anew around the camera at a height; those that are known are held better."""
        for stem in stems:
            known = [one for one in self._near(stem.place_m, 1.0) if one.layers > 0.0]
            twin = min(known, key=lambda one: float(np.linalg.norm(one.mean_m - stem.place_m)), default=None)
            if twin is None or np.linalg.norm(twin.mean_m - stem.place_m) > self._config.stem_m:
                self._put(Hypothesis(stem.place_m, SIGMA_M**2 * np.eye(2), height_m, self._prior, stem.layers))
            elif stem.layers >= twin.layers:
                twin.mean_m, twin.layers = stem.place_m, stem.layers

    def look(self, depth: DepthImage, sightings: list[Sighting]) -> None:
        """One view: its boxes, and what it shows without one."""
        from_m = depth.view.position_m[:2]
        near = self._near(from_m, self._config.farthest_m)
        meant, shares = self._paired(near, sightings)
        hit_ones = [one or self._begin(sighting, depth) for one, sighting in zip(meant, sightings, strict=True)]
        for sighting, one, share in zip(sightings, hit_ones, shares, strict=True):
            self._hit(one, sighting, depth, share)
        near += [one for one, known in zip(hit_ones, meant, strict=True) if known is None]
        if not near:
            return
        means, spreads = np.array([one.mean_m for one in near]), np.array([one.covariance for one in near])
        columns = Columns.of(means, depth)
        covered = columns.under(sightings)
        for k in np.flatnonzero(columns.shown):
            if not any(near[k] is one for one in hit_ones):
                self._missed(near[k], depth.view, covered=bool(covered[k]))
        numbers = np.array([one.number for one in near])
        self._looks.add(numbers, means, spreads, columns=columns, sightings=sightings, from_m=from_m)

    def pointed_at(self) -> list[Hypothesis]:
        """Those that a box ever meant, the most probable first; what boxes alone point at joins the stem it means."""
        return self._joined([replace(one, best=list(one.best)) for one in self if one.hits])

    def settled(self) -> list[Hypothesis]:
        """The same, as probable as all views together make them. Takes a second for some hundred views with boxes."""
        ones = sorted(self, key=lambda one: one.number)
        prior = np.array([self._prior if one.layers > 0.0 else self._prior_free for one in ones])
        odds = settled(
            prior + self._looks.unclaimed(len(ones)), self._looks.claims, self._config.evidence.most_log_odds
        )
        told = zip(ones, odds.tolist(), strict=True)
        return self._joined([replace(one, best=list(one.best), log_odds=said) for one, said in told if one.hits])

    def _joined(self, hit: list[Hypothesis]) -> list[Hypothesis]:
        """What is merged here goes on apart."""
        free = sorted((one for one in hit if one.layers == 0.0), key=lambda one: -one.log_odds)
        kept = [one for one in hit if one.layers > 0.0]
        for one in free:
            twin = min(kept, key=lambda other: self._squared(one, other), default=None)
            if twin is not None and self._squared(one, twin) < self._config.gate:
                self._merge(twin, one)
            else:
                kept.append(one)
        return sorted(kept, key=lambda one: -one.log_odds)

    def _near(self, place_m: Array, radius_m: float) -> list[Hypothesis]:
        low, high = np.floor((place_m - radius_m) / BLOCK_M), np.floor((place_m + radius_m) / BLOCK_M)
        blocks = ((i, j) for i in range(int(low[0]), int(high[0]) + 1) for j in range(int(low[1]), int(high[1]) + 1))
        found = [one for block in blocks for one in self._blocks.get(block, ())]
        return [one for one in found if np.linalg.norm(one.mean_m - place_m) < radius_m]

    def _put(self, one: Hypothesis) -> None:
        one.number, self._count = self._count, self._count + 1
        x, y = np.floor(one.mean_m / BLOCK_M)
        self._blocks[int(x), int(y)].append(one)

    def _paired(self, near: list[Hypothesis], sightings: list[Sighting]) -> tuple[list[Hypothesis | None], list[float]]:
        """For each sighting the one it means, None for none known, and how sure that is beside the others."""
        if not near or not sightings:
            return [None] * len(sightings), [1.0] * len(sightings)
        squared = np.array([self._distances(near, sighting) for sighting in sightings]).T
        cost = np.where(squared < self._config.gate, squared, NEVER)
        likely = np.exp(-0.5 * np.minimum(squared, 50.0)) * (cost < NEVER)
        rows, cols = linear_sum_assignment(cost)
        meant: list[Hypothesis | None] = [None] * len(sightings)
        shares = [1.0] * len(sightings)
        for i, j in zip(rows.tolist(), cols.tolist(), strict=True):
            if cost[i, j] < NEVER:
                meant[j], shares[j] = near[i], float(likely[i, j] / likely[:, j].sum())
        return meant, shares

    def _distances(self, near: list[Hypothesis], sighting: Sighting) -> Array:
        """(h,) chi-square of each hypothesis as what a box means, along its bearing and across apart."""
        means, spreads = np.array([one.mean_m for one in near]), np.array([one.covariance for one in near])
        known = np.array([one.log_odds > 0.0 for one in near])
        ahead = sighting.ahead
        aside = np.array([-ahead[1], ahead[0]])
        away = means - sighting.place_m
        along, across = (
            (away @ axis) ** 2 / (np.einsum("i,hij,j->h", axis, spreads, axis) + sigma_m**2)
            for axis, sigma_m in zip((ahead, aside), sighting.sigma_m, strict=True)
        )
        behind = known & (away @ ahead > 0.0)
        return np.asarray(np.where(behind, np.minimum(along, self._config.hidden), along) + across)

    def _begin(self, sighting: Sighting, depth: DepthImage) -> Hypothesis:
        height_m = float(depth.view.position_m[2])
        begun = Hypothesis(sighting.place_m, sighting.covariance, height_m, self._prior_free)
        self._put(begun)
        return begun

    def _hit(self, one: Hypothesis, sighting: Sighting, depth: DepthImage, share: float) -> None:
        config, view = self._config, depth.view
        fresh = one.freshness(view.position_m[:2], config)
        if one.layers == 0.0 and one.hits:
            one.correct(sighting, fresh)
        change = hit(sighting.confidence, sighting.range_m, config.farthest_m, config.evidence, share)
        one.add(fresh * change, config)
        one.first_ns = one.first_ns if one.hits else view.stamp_ns
        one.last_ns = view.stamp_ns
        one.views += 1
        one.hits += 1
        one.ranges_m += sighting.range_m
        one.lasting_rad, one.lasting_m = view.lasting_rad, view.lasting_m
        one.show(View(view.stamp_ns, sighting.box_px, sighting.confidence, sighting.range_m), config.views_kept)

    def _missed(self, one: Hypothesis, view: CameraView, *, covered: bool) -> None:
        config, from_m = self._config, view.position_m[:2]
        share = config.covered if covered else 1.0
        range_m = float(np.linalg.norm(one.mean_m - from_m))
        one.add(share * one.freshness(from_m, config) * miss(range_m, config.farthest_m, config.evidence), config)
        one.views += 1

    @staticmethod
    def _squared(one: Hypothesis, other: Hypothesis) -> float:
        away = one.mean_m - other.mean_m
        free = (one.layers == 0.0) + (other.layers == 0.0)
        spread = one.covariance + other.covariance + free * NEAR_SIDE_M**2 * np.eye(2)
        return float(away @ np.linalg.solve(spread, away))

    def _merge(self, into: Hypothesis, other: Hypothesis) -> None:
        if into.layers == 0.0:
            gain = into.covariance @ np.linalg.inv(into.covariance + other.covariance)
            into.mean_m = into.mean_m + gain @ (other.mean_m - into.mean_m)
            into.covariance = (np.eye(2) - gain) @ into.covariance
        into.add(other.log_odds - self._prior_free, self._config)  # its prior stood in both
        into.hits += other.hits
        into.views = max(into.views, other.views, into.hits)  # both were looked for in the same images
        into.ranges_m += other.ranges_m
        into.first_ns, into.last_ns = min(into.first_ns, other.first_ns), max(into.last_ns, other.last_ns)
        for view in other.best:
            into.show(view, self._config.views_kept)
