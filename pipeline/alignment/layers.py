"""What two maps have in common, as pairs of rasters: one fixed, one that is moved over it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import fft

from pipeline.alignment.grid import Array, Grid, Mask

CORRELATED_M = 10.0
"""Cells farther apart than this count as independent."""
ROUGH_M = 0.2
"""Two ground models of one place differ by this much, whatever their sources."""


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """fixed: (nx, ny) on the grid of the fixed map, moving: (mx, my) on that of the moved one, with their masks.

    same_scale: both are heights in metres, and their difference has to be constant; else any linear relation will do,
    as long as it rises.
    independent: independent observations for each cell (`independence`).
    """

    name: str
    fixed: Array
    known: Mask
    moving: Array
    seen: Mask
    same_scale: bool
    independent: float

    def nats(self, sums: Array) -> Array:
        """(k,) log-likelihood ratio of related against unrelated, from sums (..., 6) of `pose_sums`, never below 0.

        For a linear relation with Gaussian residuals it is -n/2 log(1 - r^2), n times the mutual information.
        """
        n = np.maximum(sums[..., 0], 1.0)
        a, b = sums[..., 1] / n, sums[..., 2] / n
        va = np.maximum(sums[..., 3] / n - a * a, 0.0)
        vb = np.maximum(sums[..., 4] / n - b * b, 0.0)
        cov = sums[..., 5] / n - a * b
        if self.same_scale:
            left = (np.maximum(va + vb - 2.0 * cov, 0.0) + ROUGH_M**2) / (va + vb + ROUGH_M**2)
        else:
            r = np.clip(cov / np.sqrt(np.maximum(va * vb, 1e-18)), 0.0, 0.999)
            left = 1.0 - r * r
        return np.asarray(np.maximum(-0.5 * self.independent * sums[..., 0] * np.log(left), 0.0))


def layer(name: str, fixed: tuple[Array, Mask], moved: tuple[Array, Mask], cell_m: float, *, same_scale: bool) -> Layer:
    """With its independence measured, and both rasters about zero, so that sums lose no digits."""
    (below, known), (above, seen) = fixed, moved
    below, above = below - _mean(below, known), above - _mean(above, seen)
    if not same_scale:
        below, above = below / _spread(below, known), above / _spread(above, seen)
    share = independence((below, known), (above, seen), cell_m)
    return Layer(name, np.where(known, below, 0.0), known, np.where(seen, above, 0.0), seen, same_scale, share)


def independence(fixed: tuple[Array, Mask], moved: tuple[Array, Mask], cell_m: float) -> float:
    """Independent observations a cell when two autocorrelated fields are correlated (Bartlett 1935).

    The variance of their correlation is the sum over lags of the product of their autocorrelations. By
    Cauchy and Schwarz that is at most what is taken here, whatever the turn between them. Rows of a plantation have
    long autocorrelations, and so count for little.
    """
    reach = round(CORRELATED_M / cell_m)
    squares = [float((autocorrelation(*one, reach) ** 2).sum()) for one in (fixed, moved)]
    return float(1.0 / max(np.sqrt(squares[0] * squares[1]), 1.0))


def autocorrelation(field: Array, mask: Mask, reach: int) -> Array:
    """(2 reach + 1, 2 reach + 1), about the mean on the mask; 0 where no pair of cells is that far apart."""
    shape = [fft.next_fast_len(size + reach, real=True) for size in field.shape]
    about = np.where(mask, field - _mean(field, mask), 0.0)
    lags = np.arange(-reach, reach + 1)
    products, pairs = (
        fft.irfft2(np.abs(fft.rfft2(one, shape)) ** 2, shape)[np.ix_(lags, lags)]
        for one in (about, mask.astype(np.float64))
    )
    variance = products[reach, reach] / max(pairs[reach, reach], 1.0)
    enough = pairs > 0.1 * pairs[reach, reach]
    return np.asarray(np.where(enough, products / np.where(enough, pairs, 1.0) / max(variance, 1e-18), 0.0))


def samples(of: Layer, grid: Grid, pivot_m: Array, most: int) -> tuple[Array, npt.NDArray[np.int64]]:
    """(n, 2) middles of the seen cells about the pivot in cells, and their flat indices; at most `most`, evenly."""
    index = np.flatnonzero(of.seen)
    index = index[:: max(1, -(-len(index) // most))]
    ix, iy = np.unravel_index(index, grid.shape)
    middles = np.column_stack([ix, iy]) + 0.5 + (grid.origin_m - pivot_m) / grid.cell_m
    return middles, index


def _mean(field: Array, mask: Mask) -> float:
    return float(field[mask].mean()) if mask.any() else 0.0


def _spread(field: Array, mask: Mask) -> float:
    return max(float(field[mask].std()), 1e-12) if mask.any() else 1.0
