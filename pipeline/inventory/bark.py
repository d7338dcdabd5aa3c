"""The radius of a slice of a stem whose scanner is known: where its points lie as that scanner would have put them.

Circles through the points of a stem are too wide: a beam strays sideways by centimetres at ten metres, as much as the
radius of a sapling; and of a stem that was seen from one side only, a circle can trade radius for distance. Both are in
the likelihood of `bark_kernels.score`: how wide the stem looks across the beams counts, less what the beam itself is
wide, and more for what is lost at its edges. Where a beam is partly beside the stem, the sensor tags many returns as
glued to what is behind, and these are not in the map: left out of account, stems at 12 m come out 0.9 cm too thin.
Maximised by scoring (Berndt, Hall, Hall and Hausman 1974).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.inventory import bark_kernels as kernels
from pipeline.inventory.bark_kernels import BLUR, RADIUS
from pipeline.inventory.config import Scanner

Doubles = npt.NDArray[np.float64]
MOST_POINTS = 700
"""Of a slice: 1 mm of a stem of 20 cm."""
AROUND_M = 0.12
"""Beyond the bark, points are taken for strays; further off they are not looked at."""
BLUR_M, BLUR_SIGMA_M = 0.01, 0.008
"""Of a map, by its trajectory, and how maps differ."""
TAPER_SIGMA = 0.001
"""Within a slice, the growth of the radius is what it was said to be."""
STRAY, LEAST_STRAY, MOST_STRAY = 0.03, 0.005, 0.5
ROUNDS = 40
FIRST = np.array([1.0, 1.0, 1.0, 0.0, 0.0])
"""1/m^2: axis and radius are known to a metre beforehand."""


@dataclass(frozen=True, slots=True)
class Bark:
    """radius_m at the slice; sigma_m of it; blur_m: of the map there; strays: share of points of something else."""

    radius_m: float
    sigma_m: float
    blur_m: float
    strays: float


def fit_bark(
    xyh: Doubles, bearing: Doubles, range_m: Doubles, *, radius_m: float, taper: float, scanner: Scanner
) -> Bark | None:
    """xyh: (n, 3) from a first axis, height above breast height; bearing: (n, 2) unit, of the beams in plan.

    range_m: (n,). radius_m: a first one. taper: growth of the radius a metre, as its share. None where nothing is told.
    """
    some = np.linspace(0, len(xyh) - 1, min(len(xyh), MOST_POINTS)).astype(int)
    seen = np.column_stack([xyh[some, :2], bearing[some], xyh[some, 2]])
    away = range_m[some]
    beams = np.column_stack(
        [
            scanner.beam_rad * away,
            scanner.range_sigma_m + scanner.range_growth * away,
            scanner.rim_m + scanner.rim_growth * away,
        ]
    )
    area = np.pi * (radius_m + AROUND_M) ** 2
    expected = np.array([0.0, 0.0, radius_m, BLUR_M, taper])
    believed = np.array([0.0, 0.0, 0.0, BLUR_SIGMA_M**-2, TAPER_SIGMA**-2])
    state, found, step = expected.copy(), expected, np.zeros(5)
    best, damping, stray = -np.inf, 1.0, STRAY
    information = np.eye(5)
    for _ in range(ROUNDS):
        value, gradient, outer, strays = kernels.score(seen, beams, scanner.rim_loss, state, stray, area)
        value -= 0.5 * float((believed * (state - expected) ** 2).sum())
        if value < best - 1e-9:  # too far: half of the way
            damping *= 0.5
            if damping < 0.02:
                break
        else:
            gain, best, found, damping = value - best, value, state, 1.0
            information = outer + np.diag(believed + FIRST)
            step = np.linalg.solve(information, gradient + believed * (expected - state))
            # As a whole: with its parts cut one by one it may lead down, and nothing is found.
            step *= min(1.0, 0.25 * state[RADIUS] / max(float(np.abs(step).max()), 1e-9))
            stray = min(max(strays, LEAST_STRAY), MOST_STRAY)
            if gain < 1e-4:
                break
        state = found + damping * step
        state[BLUR], state[RADIUS] = max(state[BLUR], 0.001), max(state[RADIUS], 0.01)
    variance = float(np.linalg.inv(information)[RADIUS, RADIUS])
    if not 0.0 < variance < 1.0:
        return None
    return Bark(float(found[RADIUS]), float(np.sqrt(variance)), float(found[BLUR]), float(stray))
