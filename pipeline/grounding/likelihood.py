"""What a view says for or against a tree, as log-odds."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from pipeline.grounding.config import EvidenceConfig

RangeT = TypeVar("RangeT", float, npt.NDArray[np.float32])


def recall(range_m: RangeT, farthest_m: float, config: EvidenceConfig) -> RangeT:
    """Share of views in which the detector finds a target at that range."""
    beyond = np.clip((range_m - config.near_m) / max(farthest_m - config.near_m, 1e-6), 0.0, 1.0)
    return config.recall_near + beyond * (config.recall_far - config.recall_near)  # type: ignore[no-any-return]


def hit(confidence: float, range_m: float, farthest_m: float, config: EvidenceConfig, share: float = 1.0) -> float:
    """Log-odds that a box adds. A confidence of one half counts as the detector's usual box.

    share: how probable it is that the box means this tree, and not another one near it.
    """
    ratio = recall(range_m, farthest_m, config) / config.false_share * sureness(confidence)
    return math.log(1.0 + share * max(ratio - 1.0, 0.0))


def sureness(confidence: float) -> float:
    """What a box counts beside the detector's usual one."""
    sure = min(max(confidence, 0.05), 0.95)
    return math.sqrt(sure / (1.0 - sure))


def miss(range_m: RangeT, farthest_m: float, config: EvidenceConfig) -> RangeT:
    """Log-odds, negative, that a view without a box adds."""
    share = (1.0 - recall(range_m, farthest_m, config)) / (1.0 - config.false_share)
    return np.log(share)  # type: ignore[no-any-return]


def log_odds(probability: float) -> float:
    """Of a probability within (0, 1)."""
    return math.log(probability / (1.0 - probability))


def probability(log_odds_: float) -> float:
    """Of log-odds."""
    return 1.0 / (1.0 + math.exp(-log_odds_))
