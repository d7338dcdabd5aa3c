"""Whether an answer may be believed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.grid import Array
from pipeline.alignment.search import Candidate

SIGMA_MOST_M, SIGMA_MOST_DEG = 1.0, 3.0


def best_rival(tops: Sequence[Candidate], config: AlignmentConfig) -> Candidate | None:
    """The best of the tops that is another answer than the first."""
    for one in tops[1:]:
        metres, degrees = one.apart(tops[0])
        if metres > config.rival_m or degrees > config.rival_deg:
            return one
    return None


def doubts(
    top: Candidate, rival: Candidate | None, covariance: Array, stems: int | None, config: AlignmentConfig
) -> list[str]:
    """Why it may not; empty when it may. stems: how many there are, where nothing but stems was compared."""
    found = []
    if stems is not None and stems < config.least_stems:
        found.append(f"{stems} stems and nothing else to compare: at least {config.least_stems} are needed")
    margin = top.nats - (rival.nats if rival is not None else 0.0)
    if rival is not None and margin < config.margin_nats:
        metres, degrees = rival.apart(top)
        found.append(
            f"another pose, {metres:.1f} m and {degrees:.0f} degrees away, explains the maps almost as well: "
            f"{margin:.1f} nats between them, {config.margin_nats:g} are asked for"
        )
    elif margin < config.margin_nats:
        found.append(f"the maps hardly answer to each other: {margin:.1f} nats, {config.margin_nats:g} are asked for")
    sigma = np.sqrt(np.diag(covariance))
    if sigma[:2].max() > SIGMA_MOST_M or math.degrees(sigma[2]) > SIGMA_MOST_DEG:
        found.append(f"the pose is known to {sigma[:2].max():.1f} m and {math.degrees(sigma[2]):.1f} degrees only")
    if max(abs(top.x_m), abs(top.y_m)) >= config.search_m - config.cell_m / 2:
        found.append(f"the best pose lies at the edge of the search of {config.search_m:g} m: search farther")
    if config.search_deg < 180.0 and abs(top.yaw_deg) >= config.search_deg - 0.5:
        found.append(f"the best pose lies at the edge of the search of {config.search_deg:g} degrees: search wider")
    return found
