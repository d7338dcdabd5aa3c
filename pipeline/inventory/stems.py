"""Stems from the points between breast height and the crowns: circles in slices, a common axis, a tapered cylinder."""

from __future__ import annotations

from dataclasses import dataclass, replace

import msgspec
import numpy as np
import numpy.typing as npt

from pipeline.inventory import circle_kernels as kernels
from pipeline.inventory.bark import BLUR_M
from pipeline.inventory.candidates import Layered, seeds
from pipeline.inventory.circle_kernels import CX, LEAN_X, RADIUS, SECTORS, TAPER
from pipeline.inventory.config import InventoryConfig, Scanner
from pipeline.inventory.diameter import measure
from pipeline.inventory.stem import BREAST_M, Slice, Stem

Doubles = npt.NDArray[np.float64]
SLICE_M = 0.5
TOLERANCE_M = 0.03
"""From the bark, where the map does not say how far off the scanner was."""
SIGMAS, LEAST_TOLERANCE_M, MOST_TOLERANCE_M = 1.7, 0.015, 0.06
BEAM_SHARE = 0.7
"""Of the points of a stem, so much of the blur across the beam is across the bark."""
THICK, CLEAR = 0.92, 0.75
"""Points that fill the tolerance are leaves, unless most of what is around lies on the bark."""
SURELY_THICK = 1.65
"""Of the spread that the range explains: leaves, whatever lies around. Stems from 10 cm have 0.6 to 1.45."""
LOW_CROWN_M, LOW_CLEAR = 2.6, 0.5
"""Small trees have leaves from here on; so much of what is around must be bark, for bushes have branches."""
UNKNOWN = 0.25
"""Sigma of a diameter, as its share beyond a centimetre: above, it is none, and mostly there is no stem either."""
TRIES = 100
REACH_M = 0.6
"""Around a candidate: a stem's near side lies within it."""
LEAST_POINTS = 8
"""In a slice."""
FROM_M = 0.6
"""The cylinder begins here: below are buttresses and grass."""
AROUND_M = 0.2
"""Beyond the bark, points are still looked at."""
TAPER_SHARE, TAPER_SIGMA = -0.045, 0.03
"""Of the radius, a metre: what stems of 10 to 40 cm do, and how they differ."""
SHOWN, SHOWN_M = 150, 0.3
TAPE_AWAY_M, TAPE_BAND_M, TAPE_POINTS = 0.1, 0.4, 8
APART_M, FOOT_M = 0.04, 0.3
"""Between the barks of two stems, at least; and between the axis of one that was followed to its crown and another."""


@dataclass(frozen=True, slots=True)
class _Circle:
    x: float
    y: float
    radius_m: float
    height_m: float
    score: float


def find_stems(points: Layered, voxel_m: float, config: InventoryConfig) -> list[Stem]:
    """Accepted ones first, then those with a `reason`. base_m is relative: x, y as the points, z 0 on the ground.

    voxel_m: of the map, if it was thinned; 0 where it is not known.
    """
    fitted = [stem for place in seeds(points, config) if (stem := _fit_any(points, place, voxel_m, config)) is not None]
    fitted.sort(key=lambda stem: (stem.reason != "", -stem.quality * len(stem.slices)))
    kept: list[Stem] = []
    for stem in fitted:
        if all(not _same(stem, other) for other in kept):
            kept.append(stem)
    return [
        stem if stem.reason else _judged_again(measure(stem, points, voxel_m, config), voxel_m, config) for stem in kept
    ]


def tolerance(points: Layered, place: Doubles, voxel_m: float, scanner: Scanner) -> float:
    """How far from the bark of a stem its points may lie: by the range they were seen from, and the map's own blur."""
    rows = points.near(place[0], place[1], 0.3)
    away = np.hypot(*(points.sensor[rows] - place).T)
    away = away[np.isfinite(away)]
    if not len(away):
        return max(TOLERANCE_M, float(np.hypot(0.02, voxel_m / 2.0)))
    spread = _spread(float(np.median(away)), voxel_m, scanner)
    return float(np.clip(SIGMAS * spread, LEAST_TOLERANCE_M, MOST_TOLERANCE_M))


def _spread(range_m: float, voxel_m: float, scanner: Scanner) -> float:
    """Sigma of points about smooth bark."""
    along = scanner.range_sigma_m + scanner.range_growth * range_m
    across = BEAM_SHARE * scanner.beam_rad * range_m
    return float(np.sqrt(BLUR_M**2 + along**2 + across**2 + voxel_m**2 / 12.0))


def _fit_any(points: Layered, place: Doubles, voxel_m: float, config: InventoryConfig) -> Stem | None:
    """As `fit`; what is no stem up to the crowns of trees may be one up to its own crown."""
    found = fit(points, place, voxel_m, config)
    if found is not None and not found.reason:
        return found
    low = fit(points, place, voxel_m, msgspec.structs.replace(config, highest_m=LOW_CROWN_M))
    if low is not None and not low.reason and low.inlier_share > LOW_CLEAR:
        return replace(low, top_m=LOW_CROWN_M)
    return found


def fit(points: Layered, place: Doubles, voxel_m: float, config: InventoryConfig) -> Stem | None:
    """The stem near a place, perhaps rejected; None where no two slices have a circle in common."""
    tolerance_m = tolerance(points, place, voxel_m, config.scanner)
    circles = _circles(points, place, config, tolerance_m)
    start = _axis(circles, config)
    if start is None:
        return None
    rows = points.near(start[CX], start[CX + 1], start[RADIUS] + AROUND_M + 0.4)
    rows = rows[(points.xyh[rows, 2] > FROM_M) & (points.xyh[rows, 2] < config.highest_m)]
    near = points.xyh[rows] - (0.0, 0.0, BREAST_M)
    taper = np.array([TAPER_SHARE * start[RADIUS], TAPER_SIGMA * start[RADIUS] + 0.001])
    fitted = kernels.fit_stem(near, start, tolerance_m, taper, 25)
    found = _judged(near, fitted, tolerance_m, config)
    return replace(found, taped=taped(near[points.reflector[rows]], fitted[0]), shown_m=_shown(near, fitted[0]))


def _shown(near: Doubles, stem: Doubles) -> npt.NDArray[np.float32]:
    """Points about breast height from the axis, a few of them."""
    mine = near[np.abs(near[:, 2]) < SHOWN_M]
    offset = mine[:, :2] - stem[:2] - mine[:, 2:] * stem[LEAN_X : LEAN_X + 2]
    offset = offset[np.hypot(offset[:, 0], offset[:, 1]) < stem[RADIUS] + AROUND_M]
    return np.asarray(offset[:: max(1, len(offset) // SHOWN)], np.float32)


def _circles(points: Layered, place: Doubles, config: InventoryConfig, tolerance_m: float) -> list[_Circle]:
    """The best circle of each slice near a place."""
    near = points.xyh[points.near(place[0], place[1], REACH_M)]
    found = []
    for number, low in enumerate(np.arange(config.lowest_m, config.highest_m - 0.1, SLICE_M).tolist()):
        xy = np.ascontiguousarray(near[(near[:, 2] >= low) & (near[:, 2] < low + SLICE_M), :2])
        if len(xy) < LEAST_POINTS:
            continue
        half = 0.5 * config.least_dbh_m
        x, y, r, score = kernels.best_circle(xy, 0.6 * half, 0.5 * config.most_dbh_m, tolerance_m, TRIES, number + 1)
        if score <= 0.0:
            continue
        x, y, r, sigma = kernels.refine_circle(xy, x, y, r, tolerance_m)
        if np.isfinite(sigma) and 0.5 * half <= r <= 0.5 * config.most_dbh_m:
            found.append(_Circle(x, y, r, low + 0.5 * SLICE_M, score))
    return found


def _axis(circles: list[_Circle], config: InventoryConfig) -> Doubles | None:
    """The straight line that most circles of about one radius agree on, as (6,) of `fit_stem`."""
    if len(circles) < 2:
        return None
    steepest = np.tan(np.radians(config.most_lean_deg))
    table = np.array([[c.x, c.y, c.height_m - BREAST_M, c.radius_m, c.score] for c in circles])
    best, chosen = 0.0, None
    for i in range(len(table)):
        for j in range(i + 1, len(table)):
            rise = table[j, 2] - table[i, 2]
            lean = (table[j, :2] - table[i, :2]) / rise
            radius = 0.5 * (table[i, 3] + table[j, 3])
            if np.hypot(*lean) > steepest or abs(table[i, 3] - table[j, 3]) > 0.35 * radius + 0.01:
                continue
            away = np.hypot(*(table[:, :2] - table[i, :2] - lean * (table[:, 2:3] - table[i, 2])).T)
            agree = (away < 0.03 + 0.25 * radius) & (np.abs(table[:, 3] - radius) < 0.35 * radius + 0.01)
            score = table[agree, 4].sum() * agree.sum()
            if score > best:
                best, chosen = score, agree
    if chosen is None or chosen.sum() < 2:
        return None
    mine = table[chosen]
    weights = np.sqrt(mine[:, 4])
    lines = np.polynomial.polynomial.polyfit(mine[:, 2], mine[:, :2], 1, w=weights)
    radius = float(np.median(mine[:, 3]))
    return np.array([*lines[0], *lines[1], radius, TAPER_SHARE * radius])


def _judged(
    near: Doubles, fitted: tuple[Doubles, Doubles, float, int], tolerance_m: float, config: InventoryConfig
) -> Stem:
    """With its slices, its figures and, where it is no stem, the reason. fitted: of `fit_stem`."""
    stem, covariance, sigma, used = fitted
    away = np.empty((len(near), 2))
    kernels.stem_residuals(near, stem, away)
    spread = sigma if np.isfinite(sigma) else TOLERANCE_M
    on = np.abs(away[:, 0]) < 2.5 * spread
    inside = (away[:, 0] < -3.0 * spread - 0.01).sum()
    beside = (np.abs(away[:, 0]) < AROUND_M).sum()
    slices = _slices(near[on], away[on], stem)
    radii = np.array([one.radius_m - stem[RADIUS] - stem[TAPER] * (one.height_m - BREAST_M) for one in slices])
    scatter = float(1.4826 * np.median(np.abs(radii - np.median(radii)))) if len(radii) > 2 else np.inf
    variance = float(covariance[RADIUS, RADIUS]) + (scatter**2 / max(len(slices), 1) if len(radii) > 2 else np.inf)
    found = Stem(
        base_m=np.array([*(stem[:2] - BREAST_M * stem[LEAN_X : LEAN_X + 2]), 0.0]),
        lean=stem[LEAN_X : LEAN_X + 2].copy(),
        dbh_m=2.0 * float(stem[RADIUS]),
        dbh_sigma_m=2.0 * float(np.sqrt(variance)),
        fitted_dbh_m=2.0 * float(stem[RADIUS]),
        taper=float(stem[TAPER]),
        sigma_m=float(spread),
        points=used,
        arc_deg=arc_of(away[on, 1]),
        inlier_share=float(on.sum() / max(beside + inside, 1)),
        slice_spread_m=scatter,
        slices=slices,
    )
    return replace(found, reason=_reason(found, int(inside), tolerance_m, config))


def arc_of(bearings: Doubles) -> float:
    """Degrees of the bark that were seen: sectors with at least 15 % of the points of the fullest one."""
    count = np.histogram(bearings, SECTORS, (-np.pi, np.pi))[0]
    least = max(1.0, 0.15 * count.max())
    return float((count >= least).sum() * 360.0 / SECTORS)


def taped(reflectors: Doubles, stem: Doubles) -> bool:
    """Whether retro-reflectors (n, 3) lie on the bark as a band of tape does: within a hand of height."""
    away = np.empty((len(reflectors), 2))
    kernels.stem_residuals(reflectors, stem, away)
    height = reflectors[np.abs(away[:, 0]) < TAPE_AWAY_M, 2]
    return bool(len(height) >= TAPE_POINTS and np.subtract(*np.percentile(height, [90, 10])) < TAPE_BAND_M)


def _slices(near: Doubles, away: Doubles, stem: Doubles) -> tuple[Slice, ...]:
    """Stretches with enough points on the bark."""
    number = np.floor((near[:, 2] + BREAST_M) / SLICE_M).astype(int)
    found = []
    for k in np.unique(number):
        mine = number == k
        arc = arc_of(away[mine, 1])
        if mine.sum() >= LEAST_POINTS and arc >= 40.0:
            height = (k + 0.5) * SLICE_M
            radius = stem[RADIUS] + stem[TAPER] * (height - BREAST_M) + np.median(away[mine, 0])
            found.append(Slice(float(height), float(radius), arc, int(mine.sum())))
    return tuple(found)


def _reason(stem: Stem, inside: int, tolerance_m: float, config: InventoryConfig) -> str:
    """Why this is no stem, in words; empty where it is one."""
    on = max(stem.points, 1)
    length = stem.slices[-1].height_m - stem.slices[0].height_m + SLICE_M if stem.slices else 0.0
    checks = (
        (stem.sigma_m > THICK * tolerance_m and stem.inlier_share < CLEAR, "as thick as leaves: no bark"),
        (not config.least_dbh_m <= stem.dbh_m <= config.most_dbh_m, f"diameter {100 * stem.dbh_m:.0f} cm"),
        (stem.lean_deg > config.most_lean_deg, f"leans by {stem.lean_deg:.0f} degrees"),
        (len(stem.slices) < config.least_slices, f"only {len(stem.slices)} slices with bark"),
        (length < config.least_length_m, f"only {length:.1f} m of stem"),
        (stem.arc_deg < config.least_arc_deg, f"only {stem.arc_deg:.0f} degrees of bark seen"),
        (inside > 0.35 * on, f"not hollow: {inside} points inside, {stem.points} on the bark"),
        (stem.inlier_share < 0.35, f"only {stem.inlier_share:.0%} of the points around are on the bark"),
        (2.0 * stem.slice_spread_m > 0.25 * stem.dbh_m + 0.01, "slices disagree about the diameter"),
    )
    return "; ".join(words for wrong, words in checks if wrong)


def _judged_again(stem: Stem, voxel_m: float, config: InventoryConfig) -> Stem:
    """After the measurement, which tells the diameter and the range better than the fit did."""
    if np.isfinite(stem.range_m) and stem.sigma_m > SURELY_THICK * _spread(stem.range_m, voxel_m, config.scanner):
        return replace(stem, reason=f"as thick as leaves: no bark at {stem.range_m:.0f} m")
    if not config.least_dbh_m <= stem.dbh_m <= config.most_dbh_m:
        return replace(stem, reason=f"diameter {100 * stem.dbh_m:.0f} cm")
    if stem.dbh_sigma_m > UNKNOWN * stem.dbh_m + 0.01:
        return replace(stem, reason=f"diameter known to {100 * stem.dbh_sigma_m:.0f} cm only")
    return stem


def _same(one: Stem, other: Stem) -> bool:
    """Whether the two stand in each other, at breast height or further up; or one is the foot of the other."""
    least = 0.5 * max(one.dbh_m, other.dbh_m) + APART_M
    if np.isfinite(min(one.top_m, other.top_m)):
        least = max(least, FOOT_M)
    return any(np.hypot(*(one.axis_at(h) - other.axis_at(h))) < least for h in (BREAST_M, 3.0))
