"""Whether an answer may be believed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.grid import Array
from pipeline.alignment.search import Candidate

SIGMA_MOST_M, SIGMA_MOST_DEG = 1.0, 3.0
TAIL = 20
"""Other answers that tell how far chance carries one; where there are fewer, the model of the score is believed."""


def best_rival(top: Candidate, answers: Sequence[Candidate], config: AlignmentConfig) -> Candidate | None:
    """The best of the answers that is another one than the top."""
    others = [one for one in answers if _another(one, top, config)]
    return max(others, key=lambda one: one.nats, default=None)


def chance_nats(answers: Sequence[Candidate], config: AlignmentConfig) -> float:
    """What wrong answers lie apart among themselves; 1 if the model of the score were true, more for sparse fields.

    The best of many have an exponential tail: its scale is their median excess over the next, by ln 2. Neither the
    right answer at the head nor a few that lean on it matter to the median. answers: best first.
    """
    apart: list[Candidate] = []
    for one in answers:
        if all(_another(one, other, config) for other in apart):
            apart.append(one)
        if len(apart) == TAIL + 2:
            break
    if len(apart) < TAIL + 2:
        return 1.0
    nats = np.array([one.nats for one in apart[1:]])
    return max(float(np.median(nats[:-1] - nats[-1])) / math.log(2.0), 1.0)


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
            f"{margin:.1f} nats between them, {config.margin_nats:.1f} are asked for"
        )
    elif margin < config.margin_nats:
        found.append(f"the maps hardly answer to each other: {margin:.1f} nats, {config.margin_nats:.1f} are asked for")
    sigma = np.sqrt(np.diag(covariance))
    if sigma[:2].max() > SIGMA_MOST_M or math.degrees(sigma[2]) > SIGMA_MOST_DEG:
        found.append(f"the pose is known to {sigma[:2].max():.1f} m and {math.degrees(sigma[2]):.1f} degrees only")
    if max(abs(top.x_m), abs(top.y_m)) >= config.search_m - config.cell_m / 2:
        found.append(f"the best pose lies at the edge of the search of {config.search_m:g} m: search farther")
    if config.search_deg < 180.0 and abs(top.yaw_deg) >= config.search_deg - 0.5:
        found.append(f"the best pose lies at the edge of the search of {config.search_deg:g} degrees: search wider")
    return found


def _another(one: Candidate, other: Candidate, config: AlignmentConfig) -> bool:
    metres, degrees = one.apart(other)
    return metres > config.rival_m or degrees > config.rival_deg
