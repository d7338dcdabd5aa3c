"""A stem as everything after the fits takes it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]
BREAST_M = 1.3


@dataclass(frozen=True, slots=True)
class Slice:
    """A stretch of a stem. height_m: of its middle. radius_m: of its own points about the common axis."""

    height_m: float
    radius_m: float
    arc_deg: float
    points: int


@dataclass(frozen=True, slots=True, eq=False)
class Stem:
    """base_m: (3,) where the axis meets the ground, from the map's origin. lean: (2,) run over rise, x and y.

    dbh_m: across the axis where it is 1.3 m above the ground, corrected; fitted_dbh_m: as the points lie.
    dbh_sigma_m: of points, slices and corrections. taper: growth of the radius a metre. sigma_m: of the points about
    the bark. reason: why it is no stem; empty for one that is.
    """

    base_m: Doubles
    lean: Doubles
    dbh_m: float
    dbh_sigma_m: float
    fitted_dbh_m: float
    taper: float
    sigma_m: float
    points: int
    arc_deg: float
    inlier_share: float
    """Of the points within a hand of the bark, those on it."""
    slice_spread_m: float
    """Sigma of the radii of the slices about the taper."""
    slices: tuple[Slice, ...] = ()
    reason: str = ""
    taped: bool = False
    """It wears a band of retro-reflecting tape."""
    range_m: float = field(default=np.nan)
    """Median distance that it was seen from, where the map says."""
    top_m: float = np.inf
    """It was followed up to there: above begins its own crown."""
    shown_m: npt.NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 2), np.float32))
    """(n, 2) some of the points about breast height, from the axis: for a picture."""

    @property
    def quality(self) -> float:
        """0..1: the least of arc, agreement of slices, and clearness."""
        arc = min(self.arc_deg / 180.0, 1.0)
        agreement = 1.0 / (1.0 + (2.0 * self.slice_spread_m / (0.06 * max(self.dbh_m, 0.05))) ** 2)
        return float(max(0.0, min(arc, agreement, self.inlier_share)))

    @property
    def lean_deg(self) -> float:
        """From the vertical."""
        return float(np.degrees(np.arctan(np.hypot(*self.lean))))

    def axis_at(self, height_m: float) -> Doubles:
        """(2,) x, y of the axis at a height above the base."""
        return np.asarray(self.base_m[:2] + self.lean * height_m)
