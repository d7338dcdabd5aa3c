"""Measured stems against taped ones: who was found, what was made up, and how far off the diameters are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

Doubles = npt.NDArray[np.float64]
WITHIN_M = 0.5
"""A measured stem is the true one within this, or within half its diameter."""
TOO_FAR = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class Diameters:
    """places_m (n, 2), dbh_m (n,), sigma_m (n,) as measured; true_m (k, 2), true_dbh_m (k,) as taped, in one frame.

    wanted: (k,) those that should be found. One that need not be is right where it is found.
    """

    places_m: Doubles
    dbh_m: Doubles
    sigma_m: Doubles
    true_m: Doubles
    true_dbh_m: Doubles
    wanted: npt.NDArray[np.bool_]


class DiameterErrors(msgspec.Struct, frozen=True):
    """true: that should be found; found: of these; measured: all; made_up: of these, where nothing stands.

    Errors are of the pairs at least as thick as asked. mre: mean of |error| over the true diameter, equation 6 of
    MapForest (arXiv 2603.22502).
    """

    true: int
    found: int
    measured: int
    made_up: int
    pairs: int
    mre: float
    rmse_m: float
    bias_m: float
    median_m: float
    """Of the size of the errors."""
    worst_m: float
    z_rms: float
    """Of errors over their stated sigmas: 1 is honest."""
    within_95: float
    """Share of errors within 1.96 stated sigmas."""
    missed: tuple[int, ...] = ()
    """Rows of the true ones."""

    @property
    def completeness(self) -> float:
        """NaN where there is nothing to find."""
        return self.found / self.true if self.true else float("nan")

    @property
    def commission(self) -> float:
        """NaN where nothing was measured."""
        return self.made_up / self.measured if self.measured else float("nan")


def diameter_errors(given: Diameters, least_m: float = 0.0) -> DiameterErrors:
    """least_m: thinner true stems need not be found and tell nothing of diameters, but are no mistake where found."""
    rows, columns = paired(given)
    wanted = given.wanted & (given.true_dbh_m >= least_m)
    hit = np.zeros(len(given.true_dbh_m), np.bool_)
    hit[columns] = True
    told = wanted[columns]
    true = given.true_dbh_m[columns[told]]
    error = given.dbh_m[rows[told]] - true
    z = error / given.sigma_m[rows[told]]
    some = len(error) > 0
    return DiameterErrors(
        true=int(wanted.sum()),
        found=int((hit & wanted).sum()),
        measured=len(given.dbh_m),
        made_up=len(given.dbh_m) - len(rows),
        pairs=len(error),
        mre=float(np.mean(np.abs(error) / true)) if some else float("nan"),
        rmse_m=float(np.sqrt(np.mean(error**2))) if some else float("nan"),
        bias_m=float(np.mean(error)) if some else float("nan"),
        median_m=float(np.median(np.abs(error))) if some else float("nan"),
        worst_m=float(np.max(np.abs(error))) if some else float("nan"),
        z_rms=float(np.sqrt(np.mean(z**2))) if some else float("nan"),
        within_95=float(np.mean(np.abs(z) < 1.96)) if some else float("nan"),
        missed=tuple(np.flatnonzero(wanted & ~hit).tolist()),
    )


def paired(given: Diameters) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Rows of measured and of true ones that are the same stem: one to one, the sum of distances least."""
    if not len(given.places_m) or not len(given.true_m):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    away = np.linalg.norm(given.places_m[:, None] - given.true_m[None], axis=2)
    reach = np.maximum(WITHIN_M, 0.5 * given.true_dbh_m)[None]
    rows, columns = linear_sum_assignment(np.where(away < reach, away, TOO_FAR))
    near = (away < reach)[rows, columns]
    return rows[near], columns[near]


def together(given: Sequence[Diameters]) -> Diameters:
    """Several plots as one: each is put where no other is."""
    far = np.array([1e5, 0.0])
    return Diameters(
        np.concatenate([one.places_m + k * far for k, one in enumerate(given)]),
        np.concatenate([one.dbh_m for one in given]),
        np.concatenate([one.sigma_m for one in given]),
        np.concatenate([one.true_m + k * far for k, one in enumerate(given)]),
        np.concatenate([one.true_dbh_m for one in given]),
        np.concatenate([one.wanted for one in given]),
    )
