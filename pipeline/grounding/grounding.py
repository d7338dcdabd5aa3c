"""Detections onto the map, view by view.

grounding = Grounding(source, GroundingConfig())
for view, detections in ...:
    grounding.look(view, detections)
trees = grounding.trees()
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.detections import FrameDetections
from pipeline.grounding.config import GroundingConfig
from pipeline.grounding.depth import DepthImage
from pipeline.grounding.evidence import Evidence
from pipeline.grounding.hypotheses import Hypotheses, Hypothesis
from pipeline.grounding.likelihood import hit, log_odds, miss
from pipeline.grounding.sighting import Sighting, sight
from pipeline.grounding.summary import tree_of
from pipeline.grounding.surroundings import Neighbourhood, PointSource, Surroundings
from pipeline.grounding.views import CameraView
from pipeline.trees import Tree

Array = npt.NDArray[np.float64]
NOTHING = np.empty((0, 3))


@dataclass(frozen=True, slots=True)
class Counts:
    """views: looked at; blind: with no map around; boxes: of the target; unplaced: of these, without a range."""

    views: int = 0
    blind: int = 0
    boxes: int = 0
    unplaced: int = 0


class Grounding:
    """Deterministic in the order of the calls; not thread-safe. evidence: by point, None to do without."""

    def __init__(self, source: PointSource, config: GroundingConfig, *, by_point: bool = True) -> None:
        self.config = config
        self.counts = Counts()
        self.evidence = Evidence(config.voxel_m, config.evidence.most_log_odds) if by_point else None
        self._hypotheses = Hypotheses(config)
        self._source = source
        self._neighbourhood = Neighbourhood(source, config.farthest_m)
        self._anchored: Surroundings | None = None
        self._last_m: Array | None = None

    def look(self, view: CameraView, detections: FrameDetections) -> Array:
        """One image. Views come in order of time. Returns the points (n, 3) that it has evidence of."""
        around = self._neighbourhood.at(view.position_m)
        if around is not None and around is not self._anchored:
            self._hypotheses.anchor(around.stems, float(view.position_m[2]))
            self._anchored = around
        boxes = target_boxes(detections, self.config.target)
        counts = self.counts
        if around is None:
            self.counts = Counts(counts.views + 1, counts.blind + 1, counts.boxes + len(boxes), counts.unplaced)
            return NOTHING
        depth = DepthImage(view, around, self.config)
        found = [sight(box, sure, depth, self.config) for box, sure in boxes]
        sightings = [one for one in found if one is not None and one.range_m < self.config.farthest_m]
        self._hypotheses.look(depth, sightings)
        missing = len(boxes) - len(sightings)
        self.counts = Counts(counts.views + 1, counts.blind, counts.boxes + len(boxes), counts.unplaced + missing)
        return NOTHING if self.evidence is None else self._mark(self.evidence, around, depth, boxes, sightings)

    def probable(self) -> list[Hypothesis]:
        """Those that are more probable than not, view by view, without what takes longer to say of them."""
        return [one for one in self._hypotheses.pointed_at() if one.log_odds > log_odds(self.config.probable)]

    def trees(self) -> list[Tree]:
        """All that were ever pointed at, the most probable by all views together first, also the improbable ones."""
        name = self.config.target
        return [
            tree_of(one, number, name, self._source, self.evidence)
            for number, one in enumerate(self._hypotheses.settled(), 1)
        ]

    def _mark(
        self,
        evidence: Evidence,
        around: Surroundings,
        depth: DepthImage,
        boxes: list[tuple[Array, float]],
        sightings: list[Sighting],
    ) -> Array:
        """Evidence for each unhidden point within range: its cell's word."""
        config, view = self.config, depth.view
        fresh = self._freshness(view.position_m)
        words = np.full(depth.range_m.shape, np.nan, np.float32)
        within = depth.range_m < config.farthest_m
        words[within] = fresh * miss(depth.range_m[within], config.farthest_m, config.evidence)
        for box, _ in boxes:  # what stands in a box before or behind the tree: nothing is said
            x0, y0, x1, y1 = np.round(box / depth.cell_px).astype(int)
            words[max(y0, 0) : y1 + 1, max(x0, 0) : x1 + 1] = np.nan
        for one in sightings:
            words[one.cells] = fresh * hit(one.confidence, one.range_m, config.farthest_m, config.evidence)
        front = np.flatnonzero(depth.unhidden(depth.seen))
        pixels = depth.seen[front, :2]
        rows, cols = words.shape
        row = np.minimum(((pixels[:, 1] + 0.5) / depth.cell_px).astype(int), rows - 1)
        col = np.minimum(((pixels[:, 0] + 0.5) / depth.cell_px).astype(int), cols - 1)
        said = words[row, col]
        points = around.points_m[front]
        evidence.add(points, said)
        return np.asarray(points[np.isfinite(said)])

    def _freshness(self, place_m: Array) -> float:
        evidence = self.config.evidence
        moved = np.inf if self._last_m is None else float(np.linalg.norm(place_m - self._last_m))
        self._last_m = place_m
        return min(max(moved / evidence.fresh_m, evidence.least_fresh), 1.0)


def target_boxes(detections: FrameDetections, target: str) -> list[tuple[Array, float]]:
    """Boxes (4,) and confidences of the class that is mapped: the named one, or the model's first."""
    wanted = detections.class_names.index(target) if target in detections.class_names else 0
    if target and target not in detections.class_names:
        return []
    which = np.flatnonzero(detections.class_id == wanted)
    return [(detections.boxes_px[k], float(detections.confidence[k])) for k in which]
