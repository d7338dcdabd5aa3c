"""The diameter at breast height of a stem, from its slices, less what the scanner adds, with its uncertainty."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import numpy.typing as npt

from pipeline.inventory.bark import AROUND_M, Bark, fit_bark
from pipeline.inventory.candidates import Layered
from pipeline.inventory.config import InventoryConfig, Scanner
from pipeline.inventory.stem import BREAST_M, Slice, Stem

Doubles = npt.NDArray[np.float64]
LOWEST_M, HIGHEST_M, SLICE_M = 0.7, 5.5, 0.6
LEAST_POINTS, LEAST_SLICES = 25, 3
COARSE_M = 0.03
"""A map of larger voxels does not tell how many beams met which part of a stem."""
TAPER, TAPER_SIGMA = -0.06, 0.06
"""Of the radius, a metre: what stems do, saplings more than trees."""
WITHIN_SLICE = -0.045
NEARBY_M = 1.5
"""Slices count half when they are this far from breast height: no stem is a cone."""
BEAM_SIGMA, RIM_SIGMA = 0.1, 0.1
"""How well the width of the beam is known, as its share, and the loss at the rim."""
FROM_BEAM, FROM_RIM = 1.7, 0.25
"""What they do to a radius: so many (sigma across)^2 / radius, and widths of the rim. Of slices of 10 to 40 cm at 3 to
12 m that were made up and measured with other figures."""
BLUR_SHARE = 0.25
"""Of the map's blur, in a radius: a stem is passed once or twice, and how the trajectory errs meanwhile is the same in
all its slices."""


def measure(stem: Stem, points: Layered, voxel_m: float, config: InventoryConfig) -> Stem:
    """The stem with the diameter that its scanner must have seen; where the map does not tell of the scanner, with the
    circles' diameter less their bias. voxel_m: of the map, if it was thinned; 0 where it is not known."""
    scanner = config.scanner
    if voxel_m > COARSE_M:  # what is lost at the rim is not missed where each voxel keeps a point
        scanner = msgspec.structs.replace(scanner, rim_loss=0.0)
    slices, range_m = _slices(stem, points, scanner)
    if len(slices) < LEAST_SLICES:
        return replace(_without_scanner(stem), range_m=range_m)
    told, barks = zip(*slices, strict=True)
    height = np.array([one.height_m for one in told]) - BREAST_M
    radius, sigma = np.array([[bark.radius_m, bark.sigma_m] for bark in barks]).T
    fitted, spread, residual = robust_line(height, radius, sigma)
    scanner_m = _scanner_sigma(fitted, range_m, config.scanner)
    blur_m = BLUR_SHARE * float(np.median([bark.blur_m for bark in barks]))
    return replace(
        stem,
        dbh_m=2.0 * fitted,
        dbh_sigma_m=float(2.0 * np.sqrt(spread**2 + scanner_m**2 + blur_m**2)),
        slices=told,
        slice_spread_m=residual,
        range_m=range_m,
    )


def _scanner_sigma(radius_m: float, range_m: float, scanner: Scanner) -> float:
    """Of a radius, by what is not known of the scanner: all slices have it in common."""
    across = scanner.beam_rad * range_m
    beam = BEAM_SIGMA * across * min(1.0, FROM_BEAM * across / max(radius_m, 0.01))
    rim = RIM_SIGMA * FROM_RIM * (scanner.rim_m + scanner.rim_growth * range_m)
    return float(np.hypot(beam, rim))


def robust_line(height: Doubles, radius: Doubles, sigma: Doubles) -> tuple[float, float, float]:
    """Radius at height 0 of a line through (n,) slices with a taper as expected, its sigma, and the slices' spread.

    Weights after Cauchy: a slice with a branch, or behind a bush, is out of line.
    """
    middle = float(np.median(radius))
    design = np.column_stack([np.ones(len(height)), height])
    prior = np.diag([0.0, (TAPER_SIGMA * middle) ** -2])
    expected = np.array([0.0, TAPER * middle / (TAPER_SIGMA * middle) ** 2])
    plain = 1.0 / ((sigma**2 + 1e-6) * (1.0 + (height / NEARBY_M) ** 2))
    robust = np.ones(len(height))
    for _ in range(8):
        weight = plain * robust
        normal = design.T @ (weight[:, None] * design) + prior
        line = np.linalg.solve(normal, design.T @ (weight * radius) + expected)
        residual = radius - design @ line
        scale = max(1.4826 * float(np.median(np.abs(residual))), 0.001)
        robust = 1.0 / (1.0 + (residual / (2.0 * np.hypot(scale, sigma))) ** 2)
    excess = max(1.0, float((weight * residual**2).sum()) / max(len(radius) - 2, 1))
    return float(line[0]), float(np.sqrt(excess * np.linalg.inv(normal)[0, 0])), scale


def _slices(stem: Stem, points: Layered, scanner: Scanner) -> tuple[list[tuple[Slice, Bark]], float]:
    """Each slice with what was found of it; and the median range that they were seen from."""
    x, y = stem.axis_at(BREAST_M)
    reach = 0.5 * stem.dbh_m + AROUND_M
    rows = points.near(x, y, reach + 5.0 * float(np.hypot(*stem.lean)))
    height = points.xyh[rows, 2] - BREAST_M
    offset = points.xyh[rows, :2] - (x, y) - height[:, None] * stem.lean
    beam = (x, y) - points.sensor[rows]
    range_m = np.hypot(beam[:, 0], beam[:, 1])
    kept = np.isfinite(range_m) & (range_m > 0.2) & (np.hypot(offset[:, 0], offset[:, 1]) < reach)
    if not kept.any():
        return [], np.nan
    height, offset, range_m, bearing = height[kept], offset[kept], range_m[kept], (beam / range_m[:, None])[kept]
    found, radius = [], 0.5 * stem.dbh_m
    for low in np.arange(LOWEST_M, min(HIGHEST_M, stem.top_m) - 0.01, SLICE_M) - BREAST_M:
        mine = (height >= low) & (height < low + SLICE_M)
        middle = low + 0.5 * SLICE_M
        if mine.sum() < LEAST_POINTS:
            continue
        xyh = np.column_stack([offset[mine], height[mine] - middle])
        bark = fit_bark(xyh, bearing[mine], range_m[mine], radius_m=radius, taper=WITHIN_SLICE, scanner=scanner)
        if bark is not None and bark.radius_m > 0.011:
            arc = stem.arc_deg
            told = Slice(float(middle + BREAST_M), bark.radius_m, arc, int(mine.sum()))
            found.append((told, bark))
    return found, float(np.median(range_m))


def _without_scanner(stem: Stem) -> Stem:
    """A circle through points with an even blur is wider than the stem by sigma^2 / r (second order, all around)."""
    radius = 0.5 * stem.fitted_dbh_m
    bias = min(2.0 * stem.sigma_m**2 / (2.0 * radius), 0.3 * radius)
    sigma = float(np.hypot(stem.dbh_sigma_m, bias))
    return replace(stem, dbh_m=stem.fitted_dbh_m - bias, dbh_sigma_m=sigma)
