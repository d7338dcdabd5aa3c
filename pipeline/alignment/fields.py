"""What a canopy and a set of stems look like to each other (equations 2 and 3 of the published method)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from pipeline.alignment.config import Lobe
from pipeline.alignment.grid import Array, Grid, Mask

CLIP_PERCENT = 0.5
"""At both ends, before a field is scaled to 0..1."""


def crown_field(canopy_m: Array, cell_m: float, scales_m: Sequence[float], lobe: Lobe) -> Array:
    """Equation 2 on a canopy height model (nx, ny): the greatest scale-normalised Laplacian of Gaussian.

    positive: of -LoG, so that crown tops alone answer. absolute: of |LoG|, which answers to gaps as well.
    """
    found = np.zeros_like(canopy_m)
    for scale_m in scales_m:
        response = -(scale_m**2) * ndimage.gaussian_laplace(canopy_m, scale_m / cell_m, mode="nearest") / cell_m**2
        np.maximum(found, response if lobe == "positive" else np.abs(response), out=found)
    return found


def stem_density(stems_m: Array, weights: Array, grid: Grid, kernel_m: float) -> Array:
    """Equation 3: stems (n, 2) as a sum of Gaussians, per square metre, by their weights (n,); none off the grid."""
    places = grid.fractional(stems_m[:, :2])
    low = np.floor(places).astype(np.int64)
    share = places - low
    counts = np.zeros(grid.shape)
    for dx in (0, 1):
        for dy in (0, 1):
            at = low + np.array([dx, dy])
            inside = np.all((at >= 0) & (at < grid.shape), axis=1)
            weight = weights * np.abs(1 - dx - share[:, 0]) * np.abs(1 - dy - share[:, 1])
            np.add.at(counts, (at[inside, 0], at[inside, 1]), weight[inside])
    return np.asarray(ndimage.gaussian_filter(counts, kernel_m / grid.cell_m, mode="constant") / grid.cell_m**2)


def scaled(field: Array, mask: Mask) -> Array:
    """0..1 between its outer percentiles on the mask: what a histogram takes."""
    if not mask.any():
        return np.zeros_like(field)
    low, high = np.percentile(field[mask], [CLIP_PERCENT, 100.0 - CLIP_PERCENT])
    return np.asarray(np.clip((field - low) / max(high - low, 1e-12), 0.0, 1.0))
