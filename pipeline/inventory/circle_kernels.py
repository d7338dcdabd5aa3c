"""Circles through noisy slices of stems, and tapered cylinders through whole stems."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Doubles = npt.NDArray[np.float64]
SECTORS = 36
CX, CY, LEAN_X, LEAN_Y, RADIUS, TAPER = range(6)


@njit(cache=True, nogil=True, inline="always")
def _next(state: np.uint64) -> np.uint64:
    """Xorshift (Marsaglia 2003): the same circles on every machine."""
    state ^= state << np.uint64(13)
    state ^= state >> np.uint64(7)
    return state ^ (state << np.uint64(17))


@njit(cache=True, nogil=True)
def through(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> tuple[float, float, float]:
    """Centre and radius of the circle through three points; radius infinite where they lie in line."""
    bx, by, cx, cy = bx - ax, by - ay, cx - ax, cy - ay
    d = 2.0 * (bx * cy - by * cx)
    if abs(d) < 1e-12:
        return ax, ay, math.inf
    b, c = bx * bx + by * by, cx * cx + cy * cy
    x, y = (cy * b - by * c) / d, (bx * c - cx * b) / d
    return ax + x, ay + y, math.hypot(x, y)


@njit(cache=True, nogil=True)
def best_circle(
    xy: Doubles, least_m: float, most_m: float, tolerance_m: float, tries: int, seed: int
) -> tuple[float, float, float, float]:
    """Centre, radius and score of the circle that most points (n, 2) lie on and fewest in; score 0 without any.

    RANSAC (Fischler and Bolles 1981). Score: points on it less twice those inside, times the root of the share of the
    circle that they cover: wood hides what is behind it, leaves do not.
    """
    n = len(xy)
    best = (0.0, 0.0, 0.0, 0.0)
    if n < 5:
        return best
    state = np.uint64(seed * 2654435761 + 88172645463325252)
    step = max(1, n // 250)
    for _ in range(tries):
        state = _next(state)
        i = int(state % np.uint64(n))
        state = _next(state)
        j = int(state % np.uint64(n))
        state = _next(state)
        k = int(state % np.uint64(n))
        x, y, r = through(xy[i, 0], xy[i, 1], xy[j, 0], xy[j, 1], xy[k, 0], xy[k, 1])
        if not least_m <= r <= most_m:
            continue
        outer, inner, hollow = (
            (r + tolerance_m) ** 2,
            max(r - tolerance_m, 0.0) ** 2,
            max(r - 1.5 * tolerance_m, 0.0) ** 2,
        )
        on, inside = 0, 0
        for m in range(0, n, step):
            squared = (xy[m, 0] - x) ** 2 + (xy[m, 1] - y) ** 2
            on += inner < squared < outer
            inside += squared < hollow
        clear = (on - 2 * inside) * step
        if clear <= best[3]:  # not even with all of the circle seen
            continue
        score = clear * math.sqrt(_covered(xy, step, x, y, inner, outer))
        if score > best[3]:
            best = (x, y, r, score)
    return best


@njit(cache=True, nogil=True)
def _covered(xy: Doubles, step: int, x: float, y: float, inner: float, outer: float) -> float:
    """Share of a circle that the points in its ring, given by squared radii, are spread over: the participation ratio
    of its sectors. A wide circle through one dense stem and some leaves has points all around, but is not covered.
    """
    count = np.zeros(SECTORS)
    for m in range(0, len(xy), step):
        dx, dy = xy[m, 0] - x, xy[m, 1] - y
        if inner < dx * dx + dy * dy < outer:
            count[min(int((math.atan2(dy, dx) + math.pi) * (SECTORS / (2.0 * math.pi))), SECTORS - 1)] += 1.0
    return float(count.sum() ** 2 / (SECTORS * (count * count).sum())) if count.any() else 0.0


@njit(cache=True, nogil=True)
def refine_circle(xy: Doubles, x: float, y: float, r: float, tolerance_m: float) -> tuple[float, float, float, float]:
    """Geometric least squares with Tukey's weights from a first circle: centre, radius, sigma of the residuals."""
    sigma = tolerance_m
    for _ in range(12):
        reach = max(3.0 * sigma, 0.01)
        normal, right = np.zeros((3, 3)), np.zeros(3)
        squared, weight = 0.0, 0.0
        for m in range(len(xy)):
            dx, dy = xy[m, 0] - x, xy[m, 1] - y
            away = math.sqrt(dx * dx + dy * dy)
            e = away - r
            if abs(e) >= reach or away < 1e-6:
                continue
            w = (1.0 - (e / reach) ** 2) ** 2
            g = (dx / away, dy / away, 1.0)
            for p in range(3):
                right[p] += w * g[p] * e
                for q in range(3):
                    normal[p, q] += w * g[p] * g[q]
            squared += w * e * e
            weight += w
        if weight < 4.0:
            return x, y, r, math.inf
        for p in range(3):
            normal[p, p] += 1e-6 * weight
        step = np.linalg.solve(normal, right)
        x, y, r = x + step[0], y + step[1], max(r + step[2], 0.005)
        # 1.35: of the weighted variance within the reach, for a normal distribution.
        sigma = min(max(1.35 * math.sqrt(squared / weight), 0.003), tolerance_m)
        if abs(step[0]) + abs(step[1]) + abs(step[2]) < 1e-5:
            break
    return x, y, r, sigma


@njit(cache=True, nogil=True)
def stem_residuals(xyh: Doubles, stem: Doubles, out: Doubles) -> None:
    """out (n, 2): distance of points (n, 3) to the bark of a stem, outwards, and bearing about its axis.

    stem: x, y of the axis at height `h = 0`, lean (run over rise) in x and y, radius there, and its growth a metre.
    Distances are across the axis, not level.
    """
    lean2 = 1.0 + stem[LEAN_X] ** 2 + stem[LEAN_Y] ** 2
    for m in range(len(xyh)):
        h = xyh[m, 2]
        dx = xyh[m, 0] - stem[CX] - stem[LEAN_X] * h
        dy = xyh[m, 1] - stem[CY] - stem[LEAN_Y] * h
        along = dx * stem[LEAN_X] + dy * stem[LEAN_Y]
        away = math.sqrt(max(dx * dx + dy * dy - along * along / lean2, 0.0))
        out[m, 0] = away - stem[RADIUS] - stem[TAPER] * h
        out[m, 1] = math.atan2(dy, dx)


@njit(cache=True, nogil=True)
def fit_stem(
    xyh: Doubles, stem: Doubles, sigma_m: float, taper: Doubles, rounds: int
) -> tuple[Doubles, Doubles, float, int]:
    """A tapered cylinder by least squares with Tukey's weights: stem (6,), its covariance (6, 6), sigma, points used.

    xyh: (n, 3) x, y and height above breast height. taper: growth of the radius a metre expected, and its sigma: short
    or half-hidden stems do not tell it.
    """
    stem, sigma, used = stem.copy(), sigma_m, 0
    covariance = np.full((6, 6), np.inf)
    for _ in range(rounds):
        reach = max(3.0 * sigma, 0.01)
        normal, right = np.zeros((6, 6)), np.zeros(6)
        squared, weight, used = 0.0, 0.0, 0
        g = np.zeros(6)
        lean2 = 1.0 + stem[LEAN_X] ** 2 + stem[LEAN_Y] ** 2
        for m in range(len(xyh)):
            h = xyh[m, 2]
            dx = xyh[m, 0] - stem[CX] - stem[LEAN_X] * h
            dy = xyh[m, 1] - stem[CY] - stem[LEAN_Y] * h
            along = dx * stem[LEAN_X] + dy * stem[LEAN_Y]
            away = math.sqrt(max(dx * dx + dy * dy - along * along / lean2, 0.0))
            e = away - stem[RADIUS] - stem[TAPER] * h
            if abs(e) >= reach or away < 1e-6:
                continue
            w = (1.0 - (e / reach) ** 2) ** 2
            nx, ny = (dx - along * stem[LEAN_X] / lean2) / away, (dy - along * stem[LEAN_Y] / lean2) / away
            g[0], g[1], g[2], g[3], g[4], g[5] = nx, ny, nx * h, ny * h, 1.0, h
            for p in range(6):
                right[p] += w * g[p] * e
                for q in range(6):
                    normal[p, q] += w * g[p] * g[q]
            squared += w * e * e
            weight += w
            used += 1
        if used < 12:
            return stem, covariance, math.inf, used
        sigma = min(max(1.35 * math.sqrt(squared / weight), 0.003), sigma_m)
        believed = (sigma / taper[1]) ** 2
        normal[TAPER, TAPER] += believed
        right[TAPER] += believed * (taper[0] - stem[TAPER])
        for p in range(5):
            normal[p, p] += 1e-6 * weight
        inverse = np.linalg.inv(normal)
        step = inverse @ right
        stem += step
        stem[RADIUS] = max(stem[RADIUS], 0.005)
        covariance = inverse * sigma * sigma
        if np.abs(step).sum() < 1e-5:
            break
    return stem, covariance, sigma, used


@njit(cache=True, nogil=True)
def gather(
    starts: npt.NDArray[np.int64], shape: tuple[int, int], low: tuple[float, float], cell_m: float,
    xy: Doubles, x: float, y: float, radius_m: float,
) -> npt.NDArray[np.int64]:  # fmt: skip
    """Indices of points (n, 2), sorted by cell, within a radius of a place. starts: (cells + 1,)."""
    nx, ny = shape
    i0 = max(int((x - radius_m - low[0]) / cell_m), 0)
    i1 = min(int((x + radius_m - low[0]) / cell_m), nx - 1)
    j0 = max(int((y - radius_m - low[1]) / cell_m), 0)
    j1 = min(int((y + radius_m - low[1]) / cell_m), ny - 1)
    most = 0
    for i in range(i0, i1 + 1):
        if j1 >= j0:
            most += starts[i * ny + j1 + 1] - starts[i * ny + j0]
    out, count = np.empty(most, np.int64), 0
    for i in range(i0, i1 + 1):
        if j1 < j0:
            break
        for m in range(starts[i * ny + j0], starts[i * ny + j1 + 1]):
            if (xy[m, 0] - x) ** 2 + (xy[m, 1] - y) ** 2 < radius_m * radius_m:
                out[count] = m
                count += 1
    return out[:count]
