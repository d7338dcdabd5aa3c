"""The published method alone: normalised mutual information (equations 4 and 5) from many starts."""

from __future__ import annotations

import numpy as np

from pipeline.alignment.config import AlignmentConfig
from pipeline.alignment.fields import scaled
from pipeline.alignment.grid import Array
from pipeline.alignment.layers import Layer, samples
from pipeline.alignment.refine import MOST_SAMPLES, Score, in_cells
from pipeline.alignment.search import Advance, Candidate, Maps
from pipeline.alignment.torch_kernels import Kernels

START_M, START_DEG = 1.0, 2.5
AT_ONCE = 2000


def information_score(maps: Maps, stems: Layer, config: AlignmentConfig, kernels: Kernels) -> Score:
    """Equation 4 of the stems' layer, as nats: what it exceeds 1 by, times joint entropy and independent cells.

    -inf where too little of the footprint overlaps: the information is biased upwards as cells get few.
    """
    xy, index = samples(stems, maps.moving, maps.pivot_m, MOST_SAMPLES)
    fixed = scaled(stems.fixed, stems.known)
    levels = np.minimum(scaled(stems.moving, stems.seen).ravel()[index] * config.bins, config.bins - 1).astype(np.int64)
    at = maps.fixed.fractional(maps.pivot_m)
    weight = stems.seen.sum() * stems.independent

    def score(poses: Array) -> Array:
        found = kernels.information(xy, levels, fixed, stems.known, in_cells(poses, at, maps.fixed.cell_m), config.bins)
        nats = (found[:, 0] - 1.0) * float(np.median(found[:, 1])) * weight
        return np.where(found[:, 2] >= config.overlap * len(xy), nats, -np.inf)

    return score


def starts(score: Score, search_m: float, search_deg: float, most: int, advance: Advance) -> list[Candidate]:
    """The best of an even lattice of poses over the whole search, no two of them neighbours."""
    shifts = np.arange(-search_m, search_m + 0.5 * START_M, START_M)
    yaws = np.arange(-search_deg, search_deg + 0.5 * START_DEG, START_DEG)
    poses = np.stack(np.meshgrid(shifts, shifts, yaws, indexing="ij"), axis=-1).reshape(-1, 3)
    found = np.empty(len(poses))
    for first in range(0, len(poses), AT_ONCE):
        found[first : first + AT_ONCE] = score(poses[first : first + AT_ONCE])
        advance(min(first + AT_ONCE, len(poses)) / len(poses))
    chosen: list[Candidate] = []
    for k in np.argsort(-found, kind="stable").tolist():
        x, y, yaw = poses[k].tolist()
        one = Candidate(x, y, yaw, float(found[k]))
        apart = [one.apart(other) for other in chosen]
        if np.isfinite(one.nats) and all(metres > 2 * START_M or deg > 2 * START_DEG for metres, deg in apart):
            chosen.append(one)
        if len(chosen) == most:
            break
    return chosen
