"""Likelihood of what a scanner says of a round stem, with all that blurs it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Doubles = npt.NDArray[np.float64]
X, Y, RADIUS, BLUR, TAPER = range(5)
_NODES = 16
_RIM = 0.25 * math.pi
_REACH = 4.0


@njit(cache=True, nogil=True)
def returned(r: float, rim_m: float, rim_loss: float) -> tuple[float, float]:
    """Share of the beams that met a stem and came back unspoilt, and its growth with the radius."""
    ratio = r / rim_m
    within = math.erf(0.5 * math.sqrt(math.pi) * ratio) / ratio
    return 1.0 - rim_loss * within, rim_loss * (within - math.exp(-_RIM * ratio * ratio)) / r


@njit(cache=True, nogil=True)
def score(
    seen: Doubles, beams: Doubles, rim_loss: float, state: Doubles, stray: float, area_m2: float
) -> tuple[float, Doubles, Doubles, float]:
    """Log-likelihood of points, its gradient (5,), the sum of outer products of the scores (5, 5), share of strays.

    A beam meets the stem at a place that is even across it, y in -r..r, but near the edges a share is lost,
    w(y) = 1 - rim_loss exp(-pi/4 ((r - |y|) / rim)^2), as many as all over a rim of that width. What is reported lies
    off across the beam and along it, and by the blur of the map in both:
    p(u, v) = integral w(y) N(u - y) N(v + sqrt(r^2 - y^2)) dy / integral w(y) dy. Strays lie anywhere in `area_m2`.

    seen: (n, 5) x, y from the first axis, direction of the beam in plan (unit), height above breast height.
    beams: (n, 3) sigma across, sigma along, width of the rim (m).
    state: shift of the axis (m), radius at breast height (m), blur (m), growth of the radius a metre as its share.
    """
    gradient, information = np.zeros(5), np.zeros((5, 5))
    total, strays = 0.0, 0.0
    g = np.zeros(5)
    blur2 = state[BLUR] ** 2
    for n in range(len(seen)):
        dx, dy = seen[n, 0] - state[X], seen[n, 1] - state[Y]
        bx, by, h = seen[n, 2], seen[n, 3], seen[n, 4]
        u, v = -by * dx + bx * dy, bx * dx + by * dy
        grown = 1.0 + state[TAPER] * h
        r = state[RADIUS] * grown
        across, along = math.sqrt(beams[n, 0] ** 2 + blur2), math.sqrt(beams[n, 1] ** 2 + blur2)
        low, high = max((u - _REACH * across) / r, -1.0), min((u + _REACH * across) / r, 1.0)
        p, pu, pv, pr, pb = 0.0, 0.0, 0.0, 0.0, 0.0
        if high > low:
            # By the angle on the bark, y = r sin(angle): even steps in y miss the edges, where it turns away.
            low = math.asin(low)
            width = (math.asin(high) - low) / _NODES
            share, growth = returned(r, beams[n, 2], rim_loss)
            scale = 0.5 * width / (2.0 * math.pi * across * along * share)
            for k in range(_NODES):
                angle = low + (k + 0.5) * width
                s, c = math.sin(angle), math.cos(angle)
                a, b = (u - r * s) / across, (v + r * c) / along
                t = r * (1.0 - abs(s)) / beams[n, 2]
                lost = rim_loss * math.exp(-_RIM * t * t)
                whole = scale * c * math.exp(-0.5 * (a * a + b * b))
                near = whole * (1.0 - lost)
                p += near
                pu -= near * a / across
                pv -= near * b / along
                pr += near * (a * s / across - b * c / along) + whole * lost * 2.0 * _RIM * t * t / r
                pb += near * ((a * a - 1.0) / across**2 + (b * b - 1.0) / along**2) * state[BLUR]
            pr -= p * growth / share
        background = stray / area_m2
        mixed = (1.0 - stray) * p + background
        total += math.log(mixed)
        strays += background / mixed
        f = (1.0 - stray) / mixed
        g[X], g[Y] = -f * (-by * pu + bx * pv), -f * (bx * pu + by * pv)
        g[RADIUS], g[BLUR] = f * pr * grown, f * pb
        g[TAPER] = f * pr * state[RADIUS] * h
        for i in range(5):
            gradient[i] += g[i]
            for j in range(5):
                information[i, j] += g[i] * g[j]
    return total, gradient, information, strays / max(len(seen), 1)
