"""Fixes as factors. What a receiver is off lasts for tens of seconds: it is estimated beside the trajectory.

A fix is the antenna, plus its lasting error, plus white noise. GTSAM has no factor for that sum, but for its parts: the
antenna and the lasting error are points of their own. A Gauss-Markov process with correlation r between neighbours of
unit variance has the energy (x^2 - 2 r x y + y^2) / (1 - r^2) = r / (1 - r^2) (x - y)^2 + (x^2 + y^2) / (1 + r), which
is a difference and two priors; what neighbours on both sides count twice is taken off.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pipeline.estimates import Array
from pipeline.refinement.config import GnssConfig
from pipeline.refinement.fixes import Fixes, Judged
from pipeline.refinement.library import gtsam

_ANYWHERE_M = 1e4
"""Sigma of what a factor does not speak of."""
_RIGID_M = 1e-3
_HORIZONTAL = 1.5
"""The kernel's width in two dimensions over that in one, at the same efficiency."""
_LEAST_KEPT = 1e-3
"""Of a lasting error: with less left of it, neighbours are strangers."""
_KERNELS = {
    "huber": ("Huber", 1.345),
    "cauchy": ("Cauchy", 2.385),
    "geman-mcclure": ("GemanMcClure", 3.0),
    "tukey": ("Tukey", 4.685),
    "welsch": ("Welsch", 2.985),
}
"""Name in GTSAM, and the width in sigmas at which 95 % of the efficiency is left."""


def add_fixes(
    graph: gtsam.NonlinearFactorGraph, fixes: Fixes, judged: Judged, config: GnssConfig, weights: Array | None = None
) -> None:
    """Those used. weights: (f, 2), horizontal and vertical, in place of the robust kernel."""
    sigma = fixes.sigma_m * judged.scale[fixes.kind][:, None]
    used = np.flatnonzero(judged.used)
    for f in used.tolist():
        if fixes.correlation_s:
            _add_antenna(graph, fixes, f)
        for part, white in enumerate(_split(fixes.white_share * sigma[f])):
            model = gtsam.noiseModel.Diagonal.Sigmas(white)
            if weights is not None:
                model = gtsam.noiseModel.Diagonal.Sigmas(white / math.sqrt(max(weights[f, part], 1e-6)))
            elif config.kernel != "squared":
                model = gtsam.noiseModel.Robust.Create(_kernel(config, part), model)
            if fixes.correlation_s:
                graph.add(gtsam.BetweenFactorPoint3(_less(f), _antenna(f), fixes.position_m[f], model))
            else:
                graph.add(gtsam.GPSFactorArm(int(fixes.keyframe[f]), fixes.position_m[f], fixes.arm_m[f], model))
    if fixes.correlation_s:
        lasting = math.sqrt(1.0 - fixes.white_share**2) * sigma
        for kind in range(fixes.kinds):
            _add_process(graph, fixes, used[fixes.kind[used] == kind], lasting)


def insert_points(values: gtsam.Values, fixes: Fixes, judged: Judged, antenna_m: Array) -> None:
    """Where the points of the fixes used begin. antenna_m: (f, 3) in `map`, by the trajectory."""
    for f in np.flatnonzero(judged.used).tolist() if fixes.correlation_s else ():
        values.insert(_antenna(f), antenna_m[f])
        values.insert(_arm(f), fixes.arm_m[f])
        values.insert(_less(f), np.zeros(3))


def kernel_weights(chi2: Array, config: GnssConfig) -> Array:
    """(f, 2) what the kernel leaves of each residual, horizontal and vertical."""
    if config.kernel == "squared":
        return np.ones_like(chi2)
    kernels = [_kernel(config, part) for part in (0, 1)]
    return np.array([[k.weight(math.sqrt(x)) for k, x in zip(kernels, row, strict=True)] for row in chi2.tolist()])


def log_norm(fixes: Fixes, judged: Judged) -> float:
    """What the likelihood of the fixes used has beside their squares: wide sigmas cost."""
    used = judged.used
    sigma = fixes.sigma_m[used] * judged.scale[fixes.kind[used]][:, None]
    return -(2.0 if fixes.correlation_s else 1.0) * float(np.log(sigma).sum())


def _add_antenna(graph: gtsam.NonlinearFactorGraph, fixes: Fixes, f: int) -> None:
    """The antenna, in `map`, where the keyframe has it."""
    rigid = gtsam.noiseModel.Isotropic.Sigma(3, _RIGID_M)
    graph.add(gtsam.PriorFactorPoint3(_arm(f), fixes.arm_m[f], rigid))
    graph.add(gtsam.ReferenceFrameFactorPoint3Pose3(_arm(f), int(fixes.keyframe[f]), _antenna(f), rigid))


def _add_process(
    graph: gtsam.NonlinearFactorGraph, fixes: Fixes, chain: npt.NDArray[np.intp], lasting_m: Array
) -> None:
    """The lasting errors of one kind of fix, in order of time."""
    keep = np.exp(-np.diff(fixes.stamps_ns[chain]) / 1e9 / fixes.correlation_s)
    keep[keep < _LEAST_KEPT] = 0.0
    shares = 1.0 / (1.0 + keep)
    alone = np.ones(len(chain))
    alone[:-1] += shares - 1.0
    alone[1:] += shares - 1.0
    for f, share in zip(chain.tolist(), alone.tolist(), strict=True):
        model = gtsam.noiseModel.Diagonal.Sigmas(lasting_m[f] / math.sqrt(share))
        graph.add(gtsam.PriorFactorPoint3(_less(f), np.zeros(3), model))
    for a, b, r in zip(chain[:-1].tolist(), chain[1:].tolist(), keep.tolist(), strict=True):
        if r:
            sigma = np.sqrt(lasting_m[a] * lasting_m[b] * (1.0 - r * r) / r)
            graph.add(
                gtsam.BetweenFactorPoint3(_less(a), _less(b), np.zeros(3), gtsam.noiseModel.Diagonal.Sigmas(sigma))
            )


def _kernel(config: GnssConfig, part: int) -> gtsam.noiseModel.mEstimator.Base:
    name, width = _KERNELS[config.kernel]
    return getattr(gtsam.noiseModel.mEstimator, name).Create(width * config.width * (_HORIZONTAL if part == 0 else 1.0))


def _split(sigma: Array) -> tuple[Array, Array]:
    """Horizontal alone, vertical alone."""
    east, north, up = sigma
    return np.array([east, north, _ANYWHERE_M]), np.array([_ANYWHERE_M, _ANYWHERE_M, up])


def _antenna(f: int) -> int:
    return int(gtsam.symbol("a", f))


def _arm(f: int) -> int:
    return int(gtsam.symbol("l", f))


def _less(f: int) -> int:
    """The lasting error of a fix, negated: antenna less this is the fix."""
    return int(gtsam.symbol("e", f))
