"""What detection and grounding left between the stages, as those who write products take it."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np
import numpy.typing as npt

from edge.process import detections_file, trees_file
from edge.process.detections_file import DetectionFacts
from edge.process.places import Places
from edge.process.tree_pictures import read_pictures
from edge.process.trees_file import PICTURES, GroundingFacts, read_trees
from pipeline.grounding.evidence import Evidence
from pipeline.grounding.likelihood import log_odds
from pipeline.products.coverage import CoverageGrid
from pipeline.products.findings import Findings, Model, PointEvidence
from pipeline.products.tiles import Tile


def read_findings(places: Places, probable: float) -> Findings:
    """probable: trees from there on are findings."""
    grounding = places.grounding
    detected = msgspec.json.decode((places.detection / detections_file.FACTS).read_bytes(), type=DetectionFacts)
    grounded = read_grounding(places)
    trees = [tree for tree in read_trees(grounding / trees_file.TREES) if tree.probability >= probable]
    model = detected.model
    return Findings(
        frame=grounded.frame,
        trees=trees,
        model=Model(model.name, model.sha256, model.demonstration),
        images=detected.images,
        coverage=CoverageGrid.load(grounding / trees_file.SEARCHED),
        chips=read_pictures(grounding / PICTURES),
        evidence=_OfPoints(Evidence.load(grounding / trees_file.EVIDENCE), log_odds(probable)),
    )


def read_grounding(places: Places) -> GroundingFacts:
    """What the grounding says of itself."""
    return msgspec.json.decode((places.grounding / trees_file.FACTS).read_bytes(), type=GroundingFacts)


@dataclass(frozen=True, slots=True, eq=False)
class _OfPoints:
    evidence: Evidence
    least: float

    def __call__(self, _tile: Tile, points: npt.NDArray[np.void]) -> PointEvidence:
        heat = self.evidence.at(points["xyz"].astype(np.float64))
        return PointEvidence(heat.probability, (heat.log_odds > self.least).astype(np.uint8), heat.seen)
