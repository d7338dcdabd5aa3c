"""What several files say of the findings of a session, computed once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from pipeline.products.areas import Patch, patches, searched_area
from pipeline.products.findings import Findings
from pipeline.products.occurrences import Columns, Survey, occurrences


@dataclass(frozen=True, slots=True, eq=False)
class Handout:
    """rows: the table of `occurrences`. patches, searched: polygons in the frame of the trees."""

    findings: Findings
    survey: Survey
    rows: Columns
    patches: list[Patch]
    searched: shapely.MultiPolygon

    @classmethod
    def of(cls, findings: Findings, survey: Survey, gap_m: float) -> Handout:
        """gap_m: trees whose crowns come closer than this share a patch."""
        crowns = np.array([tree.crown_m for tree in findings.trees], np.float64)
        grown = patches(findings.positions_m, crowns, gap_m)
        return cls(findings, survey, occurrences(findings, survey), grown, searched_area(findings.coverage))
