"""How far the geoid, which people call sea level, lies above the ellipsoid at the site."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drivers.messages import GnssFix


@dataclass(frozen=True, slots=True)
class Geoid:
    """Orthometric height = ellipsoidal height - undulation_m. NaN: not known, and `source` says why."""

    undulation_m: float
    source: str

    @property
    def known(self) -> bool:
        """Whether there are orthometric heights."""
        return math.isfinite(self.undulation_m)

    @property
    def words(self) -> str:
        """For the metadata of products."""
        known = "heights above the WGS 84 ellipsoid"
        if not self.known:
            return f"{known}; orthometric heights unknown: {self.source}"
        return f"{known}; orthometric = ellipsoidal - ({self.undulation_m:.2f} m), {self.source}"


def constant_geoid(undulation_m: float) -> Geoid:
    """As configured."""
    return Geoid(undulation_m, "constant undulation of the configuration")


def receiver_geoid(fixes: Sequence[GnssFix]) -> Geoid:
    """The separation of the receiver's own model, the median over the session.

    Exactly zero is what receivers write that have no model.
    """
    told = np.array([fix.geoid_separation_m for fix in fixes])
    told = told[np.isfinite(told) & (told != 0.0)]
    if not len(told):
        return Geoid(math.nan, "the receiver gave no geoid separation")
    return Geoid(float(np.median(told)), f"separation of the receiver's geoid model (GGA), median of {len(told)} fixes")
